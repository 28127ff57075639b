#pragma once

#include <Eigen/Dense>
#include <Eigen/Sparse>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "core/algorithm/linear/block/block_matrix.hpp"
#include "stiction/body_space.hpp"

/// The multigrid of docs/math/multigrid.md a second time, with Eigen's matrices and standard containers, for scenes
/// whose bodies are all joined. Counts of iterations are compared with it.
namespace stiction::test::reference {

class AggregationMultigrid {
 public:
  using Matrix = Eigen::SparseMatrix<double, Eigen::RowMajor>;
  using Vector = Eigen::VectorXd;

  /// positions: three for each body.
  AggregationMultigrid(const Matrix& H, const std::vector<double>& positions, const MultigridOptions& options)
      : visits_(options.cycle == Cycle::w ? 2 : 1) {
    const bool is_smoothed = options.prolongation == Prolongation::smoothed;
    Places places = positions;
    levels_.push_back({H, {}, {}, 2.0});
    while (bodies(levels_.back().H) > kCoarsest) {
      Level& level = levels_.back();
      level.D = block_inverse(level.H);
      if (is_smoothed && levels_.size() > 1) level.rho = 1.1 * radius(level);
      const Graph graph(level.H);
      const Places fine = places;
      places.clear();
      for (const std::size_t body : graph.root)
        places.insert(places.end(), fine.begin() + 3 * static_cast<std::ptrdiff_t>(body),
                      fine.begin() + 3 * static_cast<std::ptrdiff_t>(body) + 3);
      level.P = is_smoothed ? smoothed(level, graph, fine, places) : rigid(level.H, graph.aggregate, fine, places);
      const Matrix HP = level.H * level.P, next = level.P.transpose() * HP;
      levels_.push_back({next, {}, {}, 2.0});
    }
    coarsest_.compute(Eigen::MatrixXd(levels_.back().H));
  }

  [[nodiscard]] std::vector<double> apply(const std::vector<double>& r) const {
    const Vector z = cycle(0, Eigen::Map<const Vector>(r.data(), static_cast<Eigen::Index>(r.size())));
    return {z.begin(), z.end()};
  }

 private:
  static constexpr std::size_t kCoarsest = 60;

  struct Level {
    Matrix H, D, P;  ///< D: the inverse of the diagonal blocks
    double rho;
  };

  static std::size_t bodies(const Matrix& H) { return static_cast<std::size_t>(H.rows()) / 6; }

  static Matrix block_inverse(const Matrix& H) {
    std::vector<Eigen::Triplet<double>> entries;
    for (Eigen::Index body = 0; body < H.rows(); body += 6) {
      const Eigen::Matrix<double, 6, 6> inverse = Eigen::MatrixXd(H.block(body, body, 6, 6)).inverse();
      for (Eigen::Index i = 0; i < 6; ++i)
        for (Eigen::Index j = 0; j < 6; ++j) entries.emplace_back(body + i, body + j, inverse(i, j));
    }
    Matrix D(H.rows(), H.cols());
    D.setFromTriplets(entries.begin(), entries.end());
    return D;
  }

  /// Largest eigenvalue of D^-1 H as twelve steps of the power method see it, y'Hy / y'D y.
  static double radius(const Level& level) {
    Vector h(level.H.rows());
    for (Eigen::Index i = 0; i < h.size(); ++i)
      h[i] = static_cast<double>(((static_cast<std::uint32_t>(i) + 1U) * 2654435761U) >> 8U) * 0x1p-23 - 1.0;
    h = level.H * h;
    double found = 1;
    for (int step = 0; step < 12; ++step) {
      const Vector y = level.D * h;
      const double weight = y.dot(h);
      h = level.H * y;
      found = y.dot(h) / weight;
    }
    return found;
  }

  using Places = std::vector<double>;  ///< three for each body
  using Block = Eigen::Matrix<double, 6, 6>;
  using Triplets = std::vector<Eigen::Triplet<double>>;
  static constexpr auto kFree = static_cast<std::size_t>(-1);

  /// Which bodies share a block, and aggregates: roots whose neighbours are all free, with them; the others go where
  /// they have most neighbours.
  struct Graph {
    std::vector<std::set<std::size_t>> neighbours;  ///< including itself
    std::vector<std::size_t> aggregate, root;

    explicit Graph(const Matrix& H) : neighbours(bodies(H)), aggregate(bodies(H), kFree) {
      for (Eigen::Index i = 0; i < H.rows(); ++i)
        for (Matrix::InnerIterator entry(H, i); entry; ++entry)
          neighbours[static_cast<std::size_t>(i) / 6].insert(static_cast<std::size_t>(entry.col()) / 6);
      for (std::size_t body = 0; body < neighbours.size(); ++body) {
        const auto& near = neighbours[body];
        if (std::any_of(near.begin(), near.end(), [&](std::size_t other) { return aggregate[other] != kFree; }))
          continue;
        for (const std::size_t other : near) aggregate[other] = root.size();
        root.push_back(body);
      }
      const std::vector<std::size_t> taken = aggregate;
      for (std::size_t body = 0; body < neighbours.size(); ++body) {
        if (taken[body] != kFree) continue;
        std::map<std::size_t, int> shared;
        for (const std::size_t other : neighbours[body])
          if (taken[other] != kFree) ++shared[taken[other]];
        int most = 0;
        for (const auto& [candidate, count] : shared)
          if (count > most) {
            most = count;
            aggregate[body] = candidate;
          }
      }
    }

    /// Aggregates that a prolongation's row knows: those of the body's neighbours.
    [[nodiscard]] bool knows(std::size_t body, std::size_t joined) const {
      const auto& near = neighbours[body];
      return std::any_of(near.begin(), near.end(), [&](std::size_t other) { return aggregate[other] == joined; });
    }
  };

  static Block block(const Matrix& H, std::size_t i, std::size_t j) {
    Block K = Block::Zero();
    for (Eigen::Index row = 0; row < 6; ++row)
      for (Matrix::InnerIterator entry(H, static_cast<Eigen::Index>(6 * i) + row); entry; ++entry)
        if (static_cast<std::size_t>(entry.col()) / 6 == j) K(row, entry.col() % 6) = entry.value();
    return K;
  }

  /// (2): velocity v + w x d, spin w; row i of w x d is w_(i+1) d_(i+2) - w_(i+2) d_(i+1).
  static Block motion(const Places& fine, std::size_t body, const Places& coarse, std::size_t aggregate) {
    Block T = Block::Identity();
    for (Eigen::Index i = 0; i < 3; ++i) {
      const auto d = [&](Eigen::Index axis) {
        const auto k = static_cast<std::size_t>(axis % 3);
        return fine[3 * body + k] - coarse[3 * aggregate + k];
      };
      T(i, 3 + (i + 1) % 3) = d(i + 2);
      T(i, 3 + (i + 2) % 3) = -d(i + 1);
    }
    return T;
  }

  static void add(Triplets& entries, std::size_t body, std::size_t aggregate, const Block& K) {
    for (Eigen::Index i = 0; i < 6; ++i)
      for (Eigen::Index j = 0; j < 6; ++j)
        entries.emplace_back(static_cast<Eigen::Index>(6 * body) + i, static_cast<Eigen::Index>(6 * aggregate) + j,
                             K(i, j));
  }

  static Matrix from(const Triplets& entries, const Places& fine, const Places& coarse) {
    Matrix matrix(static_cast<Eigen::Index>(2 * fine.size()), static_cast<Eigen::Index>(2 * coarse.size()));
    matrix.setFromTriplets(entries.begin(), entries.end());
    return matrix;
  }

  static Matrix rigid(const Matrix& H, const std::vector<std::size_t>& aggregate, const Places& fine,
                      const Places& coarse) {
    Triplets entries;
    for (std::size_t body = 0; body < bodies(H); ++body)
      add(entries, body, aggregate[body], motion(fine, body, coarse, aggregate[body]));
    return from(entries, fine, coarse);
  }

  /// Aggregate that each body moves with, in three rounds from roots. A body takes the graph's where a member of it
  /// holds the body. Else it takes that of the neighbour that holds it most firmly.
  static std::vector<std::size_t> labels(const Matrix& H, const Graph& graph) {
    const std::size_t n = bodies(H);
    std::vector<std::size_t> label(n, kFree);
    std::vector<double> weight(n);
    for (std::size_t body = 0; body < n; ++body) weight[body] = block(H, body, body).squaredNorm();
    for (std::size_t k = 0; k < graph.root.size(); ++k) label[graph.root[k]] = k;
    for (int round = 0; round < 3; ++round) {
      const std::vector<std::size_t> before = label;
      for (std::size_t body = 0; body < n; ++body) {
        if (before[body] != kFree) continue;
        double firmest = 0;
        for (const std::size_t other : graph.neighbours[body]) {
          if (before[other] == kFree || !graph.knows(body, before[other])) continue;
          const double square = block(H, body, other).squaredNorm();
          if (square * square <= std::ldexp(weight[body] * weight[other], -30)) continue;
          const bool is_graphs = before[other] == graph.aggregate[body];
          if (is_graphs || square > firmest) label[body] = before[other];
          if (is_graphs) break;
          firmest = std::max(firmest, square);
        }
      }
    }
    for (std::size_t body = 0; body < n; ++body)
      if (label[body] == kFree) label[body] = graph.aggregate[body];
    return label;
  }

  /// (3), with couplings to aggregates that a row does not know taken as moving along.
  static Matrix smoothed(const Level& level, const Graph& graph, const Places& fine, const Places& coarse) {
    const std::vector<std::size_t> label = labels(level.H, graph);
    Triplets forces;
    for (std::size_t body = 0; body < label.size(); ++body)
      for (const std::size_t other : graph.neighbours[body]) {
        const std::size_t seen = graph.knows(body, label[other]) ? label[other] : label[body];
        add(forces, body, seen, block(level.H, body, other) * motion(fine, other, coarse, seen));
      }
    const Matrix force = from(forces, fine, coarse);
    return rigid(level.H, label, fine, coarse) - Matrix(4.0 / (3.0 * level.rho) * (level.D * force));
  }

  /// Two sweeps with the zeros of Chebyshev's polynomial on [rho / 8, rho], the coarse level, the sweeps backwards.
  [[nodiscard]] Vector cycle(std::size_t l, const Vector& r) const {
    const Level& level = levels_[l];
    if (l + 1 == levels_.size()) return coarsest_.solve(r);
    const double middle = 9.0 / 16 * level.rho, zero = 7.0 / 16 * level.rho / std::sqrt(2.0);
    Vector z = Vector::Zero(r.size());
    const auto sweep = [&](double root) {
      const Vector residual = r - level.H * z;
      z += level.D * residual / root;
    };
    sweep(middle + zero);
    sweep(middle - zero);
    const Vector coarse_right = level.P.transpose() * Vector(r - level.H * z);
    Vector coarse = Vector::Zero(coarse_right.size());
    const int visits = l + 2 == levels_.size() ? 1 : visits_;
    for (int visit = 0; visit < visits; ++visit)
      coarse += cycle(l + 1, Vector(coarse_right - levels_[l + 1].H * coarse));
    z += level.P * coarse;
    sweep(middle - zero);
    sweep(middle + zero);
    return z;
  }

  int visits_;
  std::vector<Level> levels_;
  Eigen::LDLT<Eigen::MatrixXd> coarsest_;
};

}  // namespace stiction::test::reference
