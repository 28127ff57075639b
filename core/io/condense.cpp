#include "core/io/condense.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/io/sparse.hpp"
#include "stiction/error.hpp"

namespace stiction::io {
namespace {

[[noreturn]] void refuse(const std::string& sentence) {
  throw Error(ErrorCode::bad_file, sentence);
}

std::size_t at(Offset offset) {
  return static_cast<std::size_t>(offset);
}

/// Degrees of freedom that M couples, each block ascending, blocks by their first member.
std::vector<std::vector<Index>> blocks_of(const Csr& M) {
  const auto dofs = static_cast<Index>(M.ptr.size()) - 1;
  std::vector<Index> parent(at(dofs));
  std::iota(parent.begin(), parent.end(), Index{0});
  const auto root = [&parent](Index dof) {
    while (parent[at(dof)] != dof) dof = parent[at(dof)] = parent[at(parent[at(dof)])];
    return dof;
  };
  for (Index row = 0; row < dofs; ++row) {
    for (Offset k = M.ptr[at(row)]; k < M.ptr[at(row) + 1]; ++k) {
      const Index a = root(row), b = root(M.col[at(k)]);
      parent[at(a < b ? b : a)] = a < b ? a : b;
    }
  }
  std::vector<Index> block(at(dofs), -1);
  std::vector<std::vector<Index>> blocks;
  for (Index dof = 0; dof < dofs; ++dof) {
    Index& of_root = block[at(root(dof))];
    if (of_root < 0) {
      of_root = static_cast<Index>(blocks.size());
      blocks.emplace_back();
    }
    blocks[at(of_root)].push_back(dof);
  }
  return blocks;
}

/// A small dense system with many right-hand sides, row by row: solves in place by elimination with row exchange.
/// Returns false if a pivot is zero or not finite.
bool solve_dense(std::vector<double>& matrix, std::vector<double>& rhs, std::size_t n, std::size_t columns) {
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t pivot = k;
    for (std::size_t i = k + 1; i < n; ++i) {
      if (std::abs(matrix[i * n + k]) > std::abs(matrix[pivot * n + k])) pivot = i;
    }
    const double diagonal = matrix[pivot * n + k];
    if (diagonal == 0.0 || !std::isfinite(diagonal)) return false;
    if (pivot != k) {
      for (std::size_t j = 0; j < n; ++j) std::swap(matrix[k * n + j], matrix[pivot * n + j]);
      for (std::size_t j = 0; j < columns; ++j) std::swap(rhs[k * columns + j], rhs[pivot * columns + j]);
    }
    for (std::size_t i = k + 1; i < n; ++i) {
      const double factor = matrix[i * n + k] / diagonal;
      if (factor == 0.0) continue;
      for (std::size_t j = k + 1; j < n; ++j) matrix[i * n + j] -= factor * matrix[k * n + j];
      for (std::size_t j = 0; j < columns; ++j) rhs[i * columns + j] -= factor * rhs[k * columns + j];
    }
  }
  for (std::size_t k = n; k-- > 0;) {
    for (std::size_t i = k + 1; i < n; ++i) {
      const double factor = matrix[k * n + i];
      if (factor == 0.0) continue;
      for (std::size_t j = 0; j < columns; ++j) rhs[k * columns + j] -= factor * rhs[i * columns + j];
    }
    for (std::size_t j = 0; j < columns; ++j) rhs[k * columns + j] /= matrix[k * n + k];
  }
  return true;
}

/// Rows of J that touch a block, ascending.
std::vector<Index> rows_of(const std::vector<Index>& block, const Csr& J_transposed) {
  std::vector<Index> rows;
  for (const Index dof : block) {
    const auto begin = J_transposed.col.begin() + J_transposed.ptr[at(dof)];
    const auto end = J_transposed.col.begin() + J_transposed.ptr[at(dof) + 1];
    rows.insert(rows.end(), begin, end);
  }
  std::sort(rows.begin(), rows.end());
  rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
  return rows;
}

}  // namespace

Condensed condense(const Csr& M, const Csr& J, const std::vector<double>& f) {
  const auto dofs = static_cast<Index>(f.size());
  const auto row_count = static_cast<Index>(J.ptr.size()) - 1;
  const Csr J_transposed = transpose(J, dofs);
  Condensed out;
  out.v_free.assign(f.size(), 0.0);
  Triplets parts;
  std::vector<Index> place(f.size(), 0);      // of a degree of freedom within its block
  std::vector<Index> slot(at(row_count), 0);  // of a row among the block's rows
  std::size_t total = 0;
  for (const std::vector<Index>& block : blocks_of(M)) {
    const std::size_t n = block.size();
    if (n > at(kMaxBlock)) {
      refuse("M couples " + std::to_string(n) + " degrees of freedom in one block, at most " +
             std::to_string(kMaxBlock) + " are condensed");
    }
    const std::vector<Index> rows = rows_of(block, J_transposed);
    const std::size_t m = rows.size();
    total += m * m;
    if (n * (m + 1) > kMaxEntries || total > kMaxEntries) {
      refuse("the condensed problem holds more than " + std::to_string(kMaxEntries) + " numbers, too many to read");
    }
    for (std::size_t i = 0; i < n; ++i) place[at(block[i])] = static_cast<Index>(i);
    for (std::size_t i = 0; i < m; ++i) slot[at(rows[i])] = static_cast<Index>(i);

    // Columns of the right-hand side: J' of the block's rows, then f.
    const std::size_t columns = m + 1;
    std::vector<double> matrix(n * n, 0.0), rhs(n * columns, 0.0);
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t dof = at(block[i]);
      for (Offset k = M.ptr[dof]; k < M.ptr[dof + 1]; ++k) matrix[i * n + at(place[at(M.col[at(k)])])] += M.val[at(k)];
      for (Offset k = J_transposed.ptr[dof]; k < J_transposed.ptr[dof + 1]; ++k) {
        rhs[i * columns + at(slot[at(J_transposed.col[at(k)])])] += J_transposed.val[at(k)];
      }
      rhs[i * columns + m] = f[dof];
    }
    if (!solve_dense(matrix, rhs, n, columns)) {
      refuse("M is singular in the block of degree of freedom " + std::to_string(block.front()));
    }

    std::vector<double> product(m * m, 0.0);
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t dof = at(block[i]);
      out.v_free[dof] = rhs[i * columns + m];
      for (Offset k = J_transposed.ptr[dof]; k < J_transposed.ptr[dof + 1]; ++k) {
        const std::size_t a = at(slot[at(J_transposed.col[at(k)])]);
        for (std::size_t b = 0; b < m; ++b) product[a * m + b] += J_transposed.val[at(k)] * rhs[i * columns + b];
      }
    }
    for (std::size_t a = 0; a < m; ++a) {
      for (std::size_t b = 0; b < m; ++b) parts.add(rows[a], rows[b], product[a * m + b]);
    }
  }
  out.A = by_rows(parts, row_count, row_count);
  return out;
}

}  // namespace stiction::io
