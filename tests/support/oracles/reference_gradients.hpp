#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "core/algorithm/linear/block/block_matrix.hpp"

/// Conjugate gradients and their preconditioners a second time, number by number and from the definitions, to compare
/// counts of iterations with. Nothing here knows blocks but for which entries a preconditioner keeps.
namespace stiction::test::reference {

/// Rows of (column, value), ascending.
using Rows = std::vector<std::vector<std::pair<std::size_t, double>>>;

inline std::size_t body_of(std::size_t row) {
  return row / static_cast<std::size_t>(kBodyBlock);
}

/// H with its bodies in that order.
inline Rows rows_of(const BlockMatrix& H, const std::vector<Index>& order) {
  constexpr auto kSix = static_cast<std::size_t>(kBodyBlock);
  std::vector<std::size_t> position(order.size());
  for (std::size_t k = 0; k < order.size(); ++k) position[static_cast<std::size_t>(order[k])] = k;
  Rows rows(order.size() * kSix);
  for (Index body = 0; body < H.pattern.rows; ++body)
    for (Index k = H.pattern.offsets[body]; k < H.pattern.offsets[body + 1]; ++k)
      for (std::size_t i = 0; i < kSix; ++i)
        for (std::size_t j = 0; j < kSix; ++j)
          rows[position[static_cast<std::size_t>(body)] * kSix + i].emplace_back(
              position[static_cast<std::size_t>(H.pattern.columns[k])] * kSix + j, H.block(k)[i * kSix + j]);
  for (auto& row : rows) std::sort(row.begin(), row.end());
  return rows;
}

inline std::vector<double> product(const Rows& A, const std::vector<double>& x) {
  std::vector<double> y(A.size());
  for (std::size_t i = 0; i < A.size(); ++i) {
    double sum = 0;
    for (const auto& [column, value] : A[i]) sum += value * x[column];
    y[i] = sum;
  }
  return y;
}

inline std::vector<double> transposed_product(const Rows& A, const std::vector<double>& x) {
  std::vector<double> y(A.size(), 0.0);
  for (std::size_t i = 0; i < A.size(); ++i)
    for (const auto& [column, value] : A[i]) y[column] += value * x[i];
  return y;
}

/// IC(0) of H on the entries (i, j), j <= i, of H for which `keeps(i, j)`: (L L')_ij = H_ij there. Kept diagonals alone
/// make it Jacobi's preconditioner, kept blocks on the diagonal block Jacobi's, all entries Meijerink and van der
/// Vorst's.
template <class Keeps>
Rows incomplete_cholesky(const Rows& H, Keeps&& keeps) {
  Rows L(H.size());
  for (std::size_t i = 0; i < H.size(); ++i)
    for (const auto& [j, value] : H[i]) {
      if (j > i || !keeps(i, j)) continue;
      double sum = value;
      auto a = L[i].begin();
      for (const auto& [k, entry] : L[j]) {
        while (a != L[i].end() && a->first < k) ++a;
        if (a == L[i].end()) break;
        if (a->first == k && k < j) sum -= a->second * entry;
      }
      L[i].emplace_back(j, j == i ? std::sqrt(sum) : sum / L[j].back().second);
    }
  return L;
}

/// (L L')^-1 r.
inline std::vector<double> solve(const Rows& L, std::vector<double> r) {
  for (std::size_t i = 0; i < L.size(); ++i) {
    for (const auto& [j, value] : L[i])
      if (j < i) r[i] -= value * r[j];
    r[i] /= L[i].back().second;
  }
  for (std::size_t i = L.size(); i-- > 0;) {
    r[i] /= L[i].back().second;
    for (const auto& [j, value] : L[i])
      if (j < i) r[j] -= value * r[i];
  }
  return r;
}

/// Kolotilina and Yeremin's G, row by row. Row i is the last row of C^-1, C C' = H. The columns are those of i's body
/// and of the `most` - 1 bodies before it, nearest by number, that it touches. They are taken as far as they are not
/// behind i.
inline Rows sparse_inverse(const Rows& H, std::size_t most) {
  Rows G(H.size());
  for (std::size_t i = 0; i < H.size(); ++i) {
    std::vector<std::size_t> bodies, columns;
    for (const auto& entry : H[i])
      if (bodies.empty() || bodies.back() != body_of(entry.first)) bodies.push_back(body_of(entry.first));
    bodies.erase(std::upper_bound(bodies.begin(), bodies.end(), body_of(i)), bodies.end());
    const std::size_t first = bodies.size() > most ? bodies.size() - most : 0;
    for (const auto& [column, value] : H[i])
      if (column <= i && body_of(column) >= bodies[first]) columns.push_back(column);
    Rows own(columns.size());
    for (std::size_t p = 0; p < columns.size(); ++p)
      for (std::size_t q = 0; q <= p; ++q) {
        const auto& row = H[columns[p]];
        const auto found =
            std::lower_bound(row.begin(), row.end(), std::pair<std::size_t, double>{columns[q], -HUGE_VAL});
        own[p].emplace_back(q, found != row.end() && found->first == columns[q] ? found->second : 0.0);
      }
    const Rows C = incomplete_cholesky(own, [](std::size_t, std::size_t) { return true; });
    // The last row of C^-1 is the solution g of C' g = e.
    std::vector<double> g(columns.size(), 0.0);
    g.back() = 1;
    for (std::size_t p = g.size(); p-- > 0;) {
      g[p] /= C[p].back().second;
      for (std::size_t q = 0; q < p; ++q) g[q] -= C[p][q].second * g[p];
    }
    for (std::size_t p = 0; p < g.size(); ++p) G[i].emplace_back(columns[p], g[p]);
  }
  return G;
}

inline double inner(const std::vector<double>& v, const std::vector<double>& w) {
  double sum = 0;
  for (std::size_t i = 0; i < v.size(); ++i) sum += v[i] * w[i];
  return sum;
}

/// Iterations of preconditioned conjugate gradients from zero until r' M^-1 r is tolerance^2 of the first (Saad 2003,
/// algorithm 9.1).
template <class Preconditioner>
Index gradient_iterations(const Rows& H, const std::vector<double>& b, double tolerance, Index most,
                          Preconditioner&& apply) {
  std::vector<double> r = b, z = apply(r), p = z;
  double energy = inner(r, z);
  const double enough = tolerance * tolerance * energy;
  Index iteration = 0;
  for (; iteration < most && energy > enough; ++iteration) {
    const std::vector<double> q = product(H, p);
    const double alpha = energy / inner(p, q);
    for (std::size_t i = 0; i < r.size(); ++i) r[i] -= alpha * q[i];
    z = apply(r);
    const double next = inner(r, z);
    for (std::size_t i = 0; i < p.size(); ++i) p[i] = z[i] + next / energy * p[i];
    energy = next;
  }
  return iteration;
}

}  // namespace stiction::test::reference
