#include "scenes/delassus.hpp"

#include <algorithm>
#include <cmath>

namespace stiction::scenes {
namespace {

std::size_t at(Index i) {
  return static_cast<std::size_t>(i);
}

/// Lower Cholesky factor of a row-major SPD matrix.
std::vector<double> cholesky(std::vector<double> m, std::size_t n) {
  for (std::size_t j = 0; j < n; ++j) {
    for (std::size_t i = j; i < n; ++i) {
      double sum = m[i * n + j];
      for (std::size_t k = 0; k < j; ++k) sum -= m[i * n + k] * m[j * n + k];
      m[i * n + j] = i == j ? std::sqrt(sum) : sum / m[j * n + j];
    }
    for (std::size_t i = 0; i < j; ++i) m[i * n + j] = 0;
  }
  return m;
}

}  // namespace

BlockMass::BlockMass(const Multibody& bodies) : offsets_(bodies.block_offsets()) {
  block_of_.resize(at(offsets_.back()));
  for (std::size_t k = 0; k + 1 < offsets_.size(); ++k) {
    Block block;
    block.first = offsets_[k];
    block.size = offsets_[k + 1] - offsets_[k];
    block.mass = bodies.mass_block(block.first, block.size);
    block.factor = cholesky(block.mass, at(block.size));
    std::fill_n(block_of_.begin() + block.first, block.size, static_cast<Index>(k));
    blocks_.push_back(std::move(block));
  }
}

Csr BlockMass::matrix() const {
  Csr m;
  for (const Block& block : blocks_) {
    for (Index i = 0; i < block.size; ++i) {
      for (Index j = 0; j < block.size; ++j) {
        const double value = block.mass[at(i) * at(block.size) + at(j)];
        if (value == 0) continue;
        m.col.push_back(block.first + j);
        m.val.push_back(value);
      }
      m.ptr.push_back(static_cast<Index>(m.col.size()));
    }
  }
  return m;
}

void BlockMass::solve_lower(const Block& block, double* x) {
  const std::size_t n = at(block.size);
  for (std::size_t i = 0; i < n; ++i) {
    double sum = x[i];
    for (std::size_t k = 0; k < i; ++k) sum -= block.factor[i * n + k] * x[k];
    x[i] = sum / block.factor[i * n + i];
  }
}

void BlockMass::solve_upper(const Block& block, double* x) {
  const std::size_t n = at(block.size);
  for (std::size_t i = n; i-- > 0;) {
    double sum = x[i];
    for (std::size_t k = i + 1; k < n; ++k) sum -= block.factor[k * n + i] * x[k];
    x[i] = sum / block.factor[i * n + i];
  }
}

std::vector<double> BlockMass::solve(std::vector<double> x) const {
  for (const Block& block : blocks_) {
    solve_lower(block, x.data() + block.first);
    solve_upper(block, x.data() + block.first);
  }
  return x;
}

void BlockMass::assemble(const Csr& J, Environment<double>& system) const {
  // Y = L^-1 J', stored row of J by row and block by block; then A_ij is the sum over shared blocks of Y_i . Y_j.
  struct Piece {
    Index block;
    std::size_t start;
  };
  struct Visit {
    Index row;
    std::size_t start;
  };
  const std::size_t row_count = J.ptr.size() - 1;
  std::vector<double> y;
  std::vector<std::vector<Piece>> pieces_of_row(row_count);
  std::vector<std::vector<Visit>> rows_of_block(blocks_.size());
  for (std::size_t i = 0; i < row_count; ++i) {
    for (Index k = J.ptr[i]; k < J.ptr[i + 1];) {
      const Index b = block_of_[at(J.col[at(k)])];
      const Block& block = blocks_[at(b)];
      const std::size_t start = y.size();
      y.resize(start + at(block.size), 0.0);
      for (; k < J.ptr[i + 1] && J.col[at(k)] < block.first + block.size; ++k) {
        y[start + at(J.col[at(k)] - block.first)] = J.val[at(k)];
      }
      solve_lower(block, y.data() + start);
      pieces_of_row[i].push_back({b, start});
      rows_of_block[at(b)].push_back({static_cast<Index>(i), start});
    }
  }

  std::vector<double> sum(row_count, 0.0);
  std::vector<bool> seen(row_count, false);
  std::vector<Index> touched;
  for (std::size_t i = 0; i < row_count; ++i) {
    touched.clear();
    for (const Piece& piece : pieces_of_row[i]) {
      const std::size_t size = at(blocks_[at(piece.block)].size);
      for (const Visit& visit : rows_of_block[at(piece.block)]) {
        double product = 0;
        for (std::size_t k = 0; k < size; ++k) product += y[piece.start + k] * y[visit.start + k];
        sum[at(visit.row)] += product;
        if (!seen[at(visit.row)]) {
          seen[at(visit.row)] = true;
          touched.push_back(visit.row);
        }
      }
    }
    std::sort(touched.begin(), touched.end());
    for (const Index j : touched) {
      system.column.push_back(j);
      system.A.push_back(sum[at(j)]);
      sum[at(j)] = 0;
      seen[at(j)] = false;
    }
    system.row_offsets.push_back(static_cast<Index>(system.column.size()));
  }
}

}  // namespace stiction::scenes
