#pragma once

#include <vector>

#include "stiction/io.hpp"

namespace stiction::io {

/// FCLIB's storage codes, its `nz`. A number that is not negative counts triplets.
inline constexpr int kByColumns = -1, kByRows = -2;

/// Entries of a sparse matrix in any order; entries of the same place add up.
struct Triplets {
  std::vector<Index> row, col;
  std::vector<double> val;
  void add(Index r, Index c, double v) {
    row.push_back(r);
    col.push_back(c);
    val.push_back(v);
  }
};

/// The matrix by rows, columns ascending, duplicates summed in the order of the triplets.
/// Every row lies in [0, rows) and every column in [0, cols): the caller checked.
Csr by_rows(const Triplets& entries, Index rows, Index cols);

/// The matrix with `cols` columns, transposed.
Csr transpose(const Csr& matrix, Index cols);

/// Appends the entries of a matrix, moved down and right.
void append(Triplets& to, const Csr& matrix, Index row_shift, Index col_shift);

}  // namespace stiction::io
