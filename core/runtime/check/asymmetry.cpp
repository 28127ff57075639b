#include "core/runtime/check/asymmetry.hpp"
#include "core/base/fp_env.hpp"

#include <cmath>
#include <limits>
#include <numeric>

#include "core/base/extents.hpp"
#include "core/runtime/check/defects.hpp"
#include "stiction/batch.hpp"
#include "stiction/error.hpp"

namespace stiction {
namespace {

/// One environment's entries, row by row, those of a row by column.
struct SortedRows {
  std::vector<Index> offsets, column;
  std::vector<double> value;
};

/// The transpose. Whatever the order in a row was, rows of the result are sorted by column: a counting sort is stable.
SortedRows transpose(const SortedRows& a) {
  const std::size_t n = a.offsets.size() - 1;
  SortedRows result{std::vector<Index>(n + 1, 0), std::vector<Index>(a.column.size()),
                    std::vector<double>(a.column.size())};
  for (const Index j : a.column) ++result.offsets[static_cast<std::size_t>(j) + 1];
  std::partial_sum(result.offsets.begin(), result.offsets.end(), result.offsets.begin());
  std::vector<Index> next(result.offsets.begin(), result.offsets.end() - 1);
  for (std::size_t i = 0; i < n; ++i) {
    for (auto k = static_cast<std::size_t>(a.offsets[i]); k < static_cast<std::size_t>(a.offsets[i + 1]); ++k) {
      const auto to = static_cast<std::size_t>(next[static_cast<std::size_t>(a.column[k])]++);
      result.column[to] = static_cast<Index>(i);
      result.value[to] = a.value[k];
    }
  }
  return result;
}

/// Walks along one sorted row, adding duplicates up.
class RowWalk {
 public:
  RowWalk(const SortedRows& a, std::size_t row)
      : a_(a), at_(static_cast<std::size_t>(a.offsets[row])), end_(static_cast<std::size_t>(a.offsets[row + 1])) {}
  /// The next column not yet taken, or one past every column.
  [[nodiscard]] Index column() const { return at_ < end_ ? a_.column[at_] : std::numeric_limits<Index>::max(); }
  /// The entry in that column, 0 if there is none; moves on behind it.
  double take(Index column_to_take) {
    double sum = 0.0;
    for (; column() == column_to_take; ++at_) sum += a_.value[at_];
    return sum;
  }

 private:
  const SortedRows& a_;
  std::size_t at_, end_;
};

double asymmetry_of(const SortedRows& unsorted) {
  const SortedRows mirror = transpose(unsorted);
  const SortedRows a = transpose(mirror);
  double largest = 0.0, difference = 0.0;
  const auto keep_larger = [](double& kept, double value) {
    if (value > kept) kept = value;
  };
  for (std::size_t i = 0; i + 1 < a.offsets.size(); ++i) {
    RowWalk here(a, i), there(mirror, i);
    for (Index j = smaller_of(here.column(), there.column()); j != std::numeric_limits<Index>::max();
         j = smaller_of(here.column(), there.column())) {
      const double ours = here.take(j), theirs = there.take(j);
      if (!std::isfinite(ours) || !std::isfinite(theirs)) return std::numeric_limits<double>::quiet_NaN();
      keep_larger(largest, std::abs(ours));
      keep_larger(difference, std::abs(ours - theirs));
    }
  }
  return largest > 0.0 ? difference / largest : 0.0;
}

}  // namespace

template <class Real>
double environment_asymmetry(const ContactBatchView<Real>& batch, Offset env) {
  SortedRows a{{0}, {}, {}};
  const Offset first = batch.env_row_offsets[env], end = first + batch.env_rows(env);
  for (Offset row = first; row < end; ++row) {
    const Index count = batch.row_entries(row);
    const Index* columns = batch.row_columns(row);
    const Real* values = batch.A + batch.row_offsets[row];
    a.column.insert(a.column.end(), columns, columns + count);
    a.value.insert(a.value.end(), values, values + count);
    a.offsets.push_back(static_cast<Index>(a.column.size()));
  }
  return asymmetry_of(a);
}

template <class Real>
std::vector<double> asymmetry(const ContactBatchView<Real>& batch) {
  const ScopedFpEnv fp_env;
  const std::vector<Defect> defects = validate_structure(batch, 1);
  if (!defects.empty()) {
    throw Error(ErrorCode::invalid_argument, "asymmetry cannot be measured: " + defects.front().message);
  }
  std::vector<double> result;
  result.reserve(static_cast<std::size_t>(batch.env_count));
  for (Offset env = 0; env < batch.env_count; ++env) result.push_back(environment_asymmetry(batch, env));
  return result;
}

template double environment_asymmetry(const ContactBatchView<float>&, Offset);
template double environment_asymmetry(const ContactBatchView<double>&, Offset);
template std::vector<double> asymmetry(const ContactBatchView<float>&);
template std::vector<double> asymmetry(const ContactBatchView<double>&);

}  // namespace stiction
