#include "core/io/sparse.hpp"

#include <numeric>

namespace stiction::io {
namespace {

/// Stable order of the entries by a key in [0, count): one pass of a counting sort.
std::vector<std::size_t> sorted(const std::vector<std::size_t>& order, const std::vector<Index>& key, Index count) {
  std::vector<std::size_t> next(static_cast<std::size_t>(count) + 1, 0);
  for (const Index k : key) ++next[static_cast<std::size_t>(k) + 1];
  std::partial_sum(next.begin(), next.end(), next.begin());
  std::vector<std::size_t> out(order.size());
  for (const std::size_t entry : order) out[next[static_cast<std::size_t>(key[entry])]++] = entry;
  return out;
}

}  // namespace

Csr by_rows(const Triplets& entries, Index rows, Index cols) {
  std::vector<std::size_t> order(entries.val.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  order = sorted(sorted(order, entries.col, cols), entries.row, rows);

  Csr matrix;
  matrix.ptr.assign(static_cast<std::size_t>(rows) + 1, 0);
  Index last_row = -1;
  for (const std::size_t entry : order) {
    const Index row = entries.row[entry], col = entries.col[entry];
    if (row == last_row && matrix.col.back() == col) {
      matrix.val.back() += entries.val[entry];
      continue;
    }
    matrix.col.push_back(col);
    matrix.val.push_back(entries.val[entry]);
    ++matrix.ptr[static_cast<std::size_t>(row) + 1];
    last_row = row;
  }
  std::partial_sum(matrix.ptr.begin(), matrix.ptr.end(), matrix.ptr.begin());
  return matrix;
}

void append(Triplets& to, const Csr& matrix, Index row_shift, Index col_shift) {
  for (std::size_t row = 0; row + 1 < matrix.ptr.size(); ++row) {
    for (Offset k = matrix.ptr[row]; k < matrix.ptr[row + 1]; ++k) {
      const auto entry = static_cast<std::size_t>(k);
      to.add(static_cast<Index>(row) + row_shift, matrix.col[entry] + col_shift, matrix.val[entry]);
    }
  }
}

Csr transpose(const Csr& matrix, Index cols) {
  Triplets entries;
  append(entries, matrix, 0, 0);
  std::swap(entries.row, entries.col);
  return by_rows(entries, cols, static_cast<Index>(matrix.ptr.size()) - 1);
}

}  // namespace stiction::io
