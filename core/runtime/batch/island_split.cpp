#include "core/runtime/batch/island_split.hpp"

#include <array>
#include <limits>
#include <numeric>
#include <utility>

#include "core/base/extents.hpp"

namespace stiction {
namespace {

/// Outcome of an environment by those of two islands: the larger one's. By EnvCode.
constexpr std::array<int, kEnvCodeCount> kGravity = {
    0,  // solved
    4,  // max_iterations
    2,  // stalled
    5,  // numerical
    7,  // invalid_input
    6,  // unsupported
    1,  // rounding
    3,  // infeasible
};

EnvCode graver(EnvCode a, EnvCode b) {
  return kGravity[static_cast<std::size_t>(b)] > kGravity[static_cast<std::size_t>(a)] ? b : a;
}

bool is_refused(EnvCode code) {
  return code == EnvCode::invalid_input || code == EnvCode::unsupported;
}

}  // namespace

template <class Real>
IslandSplit<Real>::IslandSplit(const ContactBatchView<Real>& batch, const Real* warm_start, bool with_motion)
    : batch_(batch), pieces_(batch.law) {
  const Islands islands = find_islands(batch);
  for (Offset env = 0; env < batch.env_count; ++env) {
    // A factor couples all rows, though it stores no such entry.
    piece_count_.push_back(batch.env_dofs(env) > 0 ? 1 : larger_of<Index>(islands.count[at(env)], 1));
    needed_ = needed_ || piece_count_.back() > 1;
  }
  if (!needed_) return;
  take_apart(islands);
  if (warm_start != nullptr)
    for (const Offset row : source_row_) warm_start_.push_back(warm_start[row]);
  answer_.lambda.resize(source_row_.size());
  if (with_motion) answer_.w.resize(source_row_.size());
  answer_.status.resize(at(piece_offsets_.back()));
}

template <class Real>
void IslandSplit<Real>::take_apart(const Islands& islands) {
  Arrays to;
  to.env_row_offsets = to.env_cone_offsets = to.cone_row_offsets = to.row_offsets = {0};
  if (batch_.factor_offsets != nullptr) to.factor_offsets = {0};
  to.column.reserve(at(batch_.nonzero_count));
  to.A.reserve(at(batch_.nonzero_count));
  piece_offsets_.push_back(0);
  for (Offset env = 0; env < batch_.env_count; ++env) {
    const std::size_t first = source_row_.size();
    add_pieces(env, islands.island.data() + batch_.env_cone_offsets[env], to);
    add_numbers(env, first, to);
  }
  pieces_ = ContactBatch<Real>::from_arrays(batch_.law, std::move(to));
}

/// The cones of one environment, piece by piece, and the new place of each row.
template <class Real>
void IslandSplit<Real>::add_pieces(Offset env, const Index* island, Arrays& to) {
  const Index pieces = piece_count_[at(env)], cones = batch_.env_cones(env);
  const auto piece_of = [&](Index cone) { return pieces == 1 ? 0 : island[cone]; };
  std::vector<Index> begin(at(pieces) + 1, 0), order(at(cones));
  for (Index c = 0; c < cones; ++c) ++begin[at(piece_of(c)) + 1];
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<Index> next(begin.begin(), begin.end() - 1);
  for (Index c = 0; c < cones; ++c) order[at(next[at(piece_of(c))]++)] = c;

  place_.resize(at(batch_.env_rows(env)));
  for (Index p = 0; p < pieces; ++p) {
    for (Index k = begin[at(p)]; k < begin[at(p) + 1]; ++k)
      add_cone(env, batch_.env_cone_offsets[env] + order[at(k)], to);
    to.env_row_offsets.push_back(static_cast<Offset>(source_row_.size()));
    to.env_cone_offsets.push_back(static_cast<Offset>(to.cone_kind.size()));
    if (batch_.env_flags != nullptr) to.env_flags.push_back(batch_.env_flags[env]);
    if (batch_.env_tolerance != nullptr) to.env_tolerance.push_back(batch_.env_tolerance[env]);
    if (batch_.env_max_iterations != nullptr) to.env_max_iterations.push_back(batch_.env_max_iterations[env]);
  }
  piece_offsets_.push_back(piece_offsets_.back() + pieces);
}

template <class Real>
void IslandSplit<Real>::add_cone(Offset env, Offset cone, Arrays& to) {
  const auto add_row = [&](Offset row) {
    place_[at(row - batch_.env_row_offsets[env])] =
        static_cast<Index>(static_cast<Offset>(source_row_.size()) - to.env_row_offsets.back());
    source_row_.push_back(row);
  };
  const Offset normal = batch_.normal_row(cone);
  add_row(normal);
  for (Offset row = batch_.cone_row_offsets[cone]; row < batch_.cone_row_offsets[cone + 1]; ++row)
    if (row != normal) add_row(row);
  // Friction is read where a cone has some: offsets of a shared mu need not be sound elsewhere.
  const bool friction = carries_friction(batch_.cone_kind[cone]);
  for (std::size_t i = at(to.cone_row_offsets.back()); i < source_row_.size(); ++i)
    to.mu.push_back(friction && source_row_[i] != normal ? batch_.mu[batch_.mu_at(source_row_[i])] : Real(0));
  to.cone_kind.push_back(batch_.cone_kind[cone]);
  if (batch_.cone_group != nullptr) to.cone_group.push_back(batch_.cone_group[cone]);
  to.cone_row_offsets.push_back(static_cast<Offset>(source_row_.size()));
}

/// The numbers of one environment's rows, which are those from `first` on.
template <class Real>
void IslandSplit<Real>::add_numbers(Offset env, std::size_t first, Arrays& to) const {
  for (std::size_t i = first; i < source_row_.size(); ++i) {
    const Offset row = source_row_[i];
    const Index entries = batch_.row_entries(row);
    const Index* const columns = batch_.row_columns(row);
    const Real* const a = batch_.A + batch_.row_offsets[row];
    for (Index k = 0; k < entries; ++k) to.column.push_back(place_[at(columns[k])]);
    to.A.insert(to.A.end(), a, a + entries);
    to.row_offsets.push_back(static_cast<Offset>(to.A.size()));
    to.b.push_back(batch_.b[row]);
    to.R.push_back(batch_.R[row]);
    to.lo.push_back(batch_.lo[row]);
    to.hi.push_back(batch_.hi[row]);
  }
  if (batch_.factor_offsets == nullptr) return;
  // Environments kept as factors are whole, and their rows are in order: normal last is for dense ones only.
  to.factor.insert(to.factor.end(), batch_.factor + batch_.factor_offsets[env],
                   batch_.factor + batch_.factor_offsets[env + 1]);
  to.factor_offsets.resize(to.env_row_offsets.size(), static_cast<Offset>(to.factor.size()));
}

template <class Real>
EnvStatus IslandSplit<Real>::joined_status(Offset env) const {
  EnvStatus joined = answer_.status[at(piece_offsets_[at(env)])];
  const Index pieces = piece_count_[at(env)];
  joined.islands = pieces > 1 ? pieces : 0;
  for (Offset piece = piece_offsets_[at(env)] + 1; piece < piece_offsets_[at(env) + 1]; ++piece) {
    const EnvStatus& status = answer_.status[at(piece)];
    joined.code = graver(joined.code, status.code);
    joined.flags |= status.flags;
    joined.iterations = larger_of(joined.iterations, status.iterations);
    if (status.residual > joined.residual) joined.residual = status.residual;
    if (status.residual_absolute > joined.residual_absolute) joined.residual_absolute = status.residual_absolute;
  }
  if (is_refused(joined.code)) {
    joined.iterations = joined.islands = 0;
    joined.residual = joined.residual_absolute = std::numeric_limits<double>::infinity();
  }
  return joined;
}

template <class Real>
void IslandSplit<Real>::join(const SolutionView<Real>& solution) const {
  const std::vector<Offset>& rows = pieces_.arrays().env_row_offsets;
  for (Offset env = 0; env < batch_.env_count; ++env) {
    const EnvStatus status = joined_status(env);
    solution.status[env] = status;
    for (Offset i = rows[at(piece_offsets_[at(env)])]; i < rows[at(piece_offsets_[at(env) + 1])]; ++i) {
      const Offset row = source_row_[at(i)];
      // If one island is refused, all are: the safe answer that islands together would have got.
      const bool refused = is_refused(status.code);
      solution.lambda[row] = refused ? Real(0) : answer_.lambda[at(i)];
      if (solution.w == nullptr) continue;
      const Real still = status.code == EnvCode::unsupported ? batch_.b[row] + Real(0) : Real(0);  // no -0
      solution.w[row] = refused ? still : answer_.w[at(i)];
    }
  }
}

template class IslandSplit<float>;
template class IslandSplit<double>;

}  // namespace stiction
