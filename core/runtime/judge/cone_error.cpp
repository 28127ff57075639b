#include "core/runtime/judge/cone_error.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

// Written from docs/math/residual.md and from nothing else. No header of core/algorithm is included here, so that a
// mistake in the solvers' residual cannot hide in the judge.

namespace stiction {
namespace {

/// Numbers of one cone. Their exponents reach far beyond a double's, so that no square over- or underflows.
using Wide = long double;

constexpr Wide kInfinity = std::numeric_limits<Wide>::infinity();

/// A bound of that size or more counts as infinite.
constexpr Wide kBoundless = 1e20L;

Wide larger(Wide a, Wide b) {
  return a < b ? b : a;
}
Wide smaller(Wide a, Wide b) {
  return b < a ? b : a;
}

/// A distance; one that is not finite is infinite.
Wide finite_or_infinite(Wide value) {
  return std::isfinite(value) ? value : kInfinity;
}

constexpr double kLargestNumber = std::numeric_limits<double>::max();

/// Up to kMaxConeRows numbers.
struct ConeVector {
  std::array<Wide, kMaxConeRows> at{};
  std::size_t size = 0;

  void push(Wide value) { at[size++] = value; }
};

/// The rows that are judged, in the judge's numbers.
struct WideRows {
  std::size_t size = 0;
  std::array<Wide, kMaxConeRows> lambda{}, w{}, diagonal{}, mu{};
  Wide lo = 0, hi = 0;

  explicit WideRows(const ConeRows& rows)
      : size(rows.size), lo(static_cast<Wide>(rows.lo)), hi(static_cast<Wide>(rows.hi)) {
    std::ranges::copy(rows.lambda, lambda.begin());
    std::ranges::copy(rows.w, w.begin());
    // One that is beyond all numbers is the largest of them: without a reaction it moves nothing.
    std::ranges::transform(rows.diagonal, diagonal.begin(),
                           [](double d) { return d > kLargestNumber ? kLargestNumber : d; });
    std::ranges::copy(rows.mu, mu.begin());
  }
};

/// Adds up squares.
class Norm {
 public:
  Norm& see(Wide value) {
    sum_ += value * value;
    return *this;
  }
  [[nodiscard]] Wide value() const { return std::sqrt(sum_); }

 private:
  Wide sum_ = 0;
};

Wide norm(Wide a, Wide b) {
  return Norm().see(a).see(b).value();
}

Wide unilateral_error(Wide x, Wide y) {
  const Wide open = norm(x, smaller(y, 0));
  const Wide pressed = norm(y, smaller(x, 0));
  return smaller(open, pressed);
}

/// Distance of (x, y) from the nearest of the members at lo, inside and at hi; an infinite bound has no member.
Wide box_error(Wide x, Wide y, Wide lo, Wide hi) {
  const Wide outside = x < lo ? lo - x : x > hi ? x - hi : 0;
  Wide least = norm(y, outside);
  if (std::isfinite(lo)) least = smaller(least, norm(x - lo, smaller(y, 0)));
  if (std::isfinite(hi)) least = smaller(least, norm(x - hi, larger(y, 0)));
  return least;
}

/// The rows of a friction cone in the unit of its normal one, without the axes that have no friction.
struct Contact {
  Wide x = 0, y = 0;            ///< of the normal row
  ConeVector along_x, along_y;  ///< of the tangential ones
  ConeVector mu;                ///< largest |x_t| / x_n along each
  ConeVector grip;              ///< the same; 0 where no reaction moves the row, so that none is missed there
  Law law = Law::convex;
};

/// Distance from the nearest pair that slides along `direction`, of unit length in the coordinates mu y_t.
Wide sliding_error(const Contact& contact, const ConeVector& direction) {
  ConeVector push, way;  // the reaction is lam (1, -push), the motion c (g, way)
  Wide pushed = contact.x, push_square = 1;
  Wide driven = contact.law == Law::convex ? contact.y : 0, way_square = contact.law == Law::convex ? 1 : 0;
  for (std::size_t k = 0; k < direction.size; ++k) {
    push.push(contact.grip.at[k] * direction.at[k]);
    way.push(direction.at[k] / contact.mu.at[k]);
    pushed -= contact.along_x.at[k] * push.at[k];
    push_square += push.at[k] * push.at[k];
    driven += contact.along_y.at[k] * way.at[k];
    way_square += way.at[k] * way.at[k];
  }
  const Wide lam = larger(0, pushed / push_square);
  const Wide c = larger(0, driven / way_square);
  Norm distance;
  distance.see(contact.x - lam).see(contact.law == Law::convex ? contact.y - c : contact.y);
  for (std::size_t k = 0; k < direction.size; ++k)
    distance.see(contact.along_x.at[k] + lam * push.at[k]).see(contact.along_y.at[k] - c * way.at[k]);
  return distance.value();
}

/// Distance of a contact from the nearest of the four members of its law.
Wide law_error(const Contact& contact) {
  const std::size_t axes = contact.mu.size;
  Norm x_length, y_length, load, slip;
  x_length.see(contact.x);
  y_length.see(contact.y);
  for (std::size_t k = 0; k < axes; ++k) {
    x_length.see(contact.along_x.at[k]);
    y_length.see(contact.along_y.at[k]);
    load.see(contact.along_x.at[k] / contact.mu.at[k]);
    slip.see(contact.along_y.at[k] * contact.mu.at[k]);
  }
  const Wide loaded = load.value(), slips = slip.value();

  const Wide gap = contact.law == Law::convex ? contact.y - slips : contact.y;
  const Wide open = norm(x_length.value(), smaller(gap, 0));

  const Wide inside = larger(contact.x, 0);
  const Wide kept = loaded > inside ? inside / loaded : 1;
  Norm stuck;
  stuck.see(y_length.value()).see(contact.x - inside);
  for (std::size_t k = 0; k < axes; ++k) stuck.see((1 - kept) * contact.along_x.at[k]);

  Wide least = smaller(finite_or_infinite(open), finite_or_infinite(stuck.value()));
  ConeVector by_motion, by_reaction;
  for (std::size_t k = 0; k < axes; ++k) {
    by_motion.push(contact.along_y.at[k] * contact.mu.at[k] / slips);
    by_reaction.push(-contact.along_x.at[k] / contact.mu.at[k] / loaded);
  }
  if (slips > 0) least = smaller(least, finite_or_infinite(sliding_error(contact, by_motion)));
  if (loaded > 0) least = smaller(least, finite_or_infinite(sliding_error(contact, by_reaction)));
  return least;
}

/// Returns the factor that brings row k to the unit of the normal row: 1 where one of the two cannot move.
Wide unit_of(const WideRows& rows, std::size_t k) {
  if (k == 0 || !(rows.diagonal[0] > 0) || !(rows.diagonal[k] > 0)) return 1;
  return std::sqrt(rows.diagonal[0] / rows.diagonal[k]);
}

/// Friction whose square is below this counts as none, in its own unit and in the normal row's.
constexpr Wide kLeastFriction = 0x1p-1000L;
bool has_friction(const WideRows& rows, std::size_t k) {
  const Wide square = rows.mu[k] * rows.mu[k];
  const bool both_move = rows.diagonal[0] > 0 && rows.diagonal[k] > 0;
  return rows.mu[k] > 0 && square * larger(1, both_move ? rows.diagonal[k] / rows.diagonal[0] : 1) > kLeastFriction;
}

/// A friction cone under a law, or boxed friction.
Wide friction_error(const WideRows& rows, ConeKind kind, Law law) {
  Contact contact;
  contact.law = law;
  contact.x = rows.diagonal[0] * rows.lambda[0];
  contact.y = rows.w[0];
  Norm carried, boxed;  // by axes without friction; errors of boxed axes
  for (std::size_t k = 1; k < rows.size; ++k) {
    if (!std::isfinite(rows.mu[k])) return kInfinity;
    const Wide unit = unit_of(rows, k);
    const Wide weight = unit * rows.diagonal[k];
    const Wide x = weight * rows.lambda[k], y = unit * rows.w[k];
    if (!has_friction(rows, k)) {
      carried.see(x);
    } else if (kind == ConeKind::box_friction) {
      const Wide bound = weight * rows.mu[k] * larger(rows.lambda[0], 0);
      boxed.see(box_error(x, y, -bound, bound));
    } else {
      contact.along_x.push(x);
      contact.along_y.push(y);
      contact.mu.push(rows.mu[k] / unit);
      contact.grip.push(rows.diagonal[k] > 0 ? rows.mu[k] / unit : 0);
    }
  }
  const Wide own = contact.mu.size == 0 ? unilateral_error(contact.x, contact.y) : law_error(contact);
  return Norm().see(own).see(boxed.value()).see(carried.value()).value();
}

/// The nearest positive semidefinite matrix to one of order n, by rotations until nothing is left to turn.
void project_matrix(std::array<std::array<Wide, 3>, 3>& S, std::size_t n) {
  std::array<std::array<Wide, 3>, 3> V{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  for (int pass = 0; pass < 60; ++pass) {
    bool turned = false;
    for (std::size_t p = 0; p + 1 < n; ++p)
      for (std::size_t q = p + 1; q < n; ++q) {
        if (std::abs(S[p][q]) <= 1e-21L * (std::abs(S[p][p]) + std::abs(S[q][q]))) continue;
        turned = true;
        const Wide angle = 0.5L * std::atan2(2 * S[p][q], S[q][q] - S[p][p]);
        const Wide c = std::cos(angle), s = std::sin(angle);
        for (auto* M : {&S, &V})
          for (std::size_t k = 0; k < n; ++k) {
            const Wide left = (*M)[k][p], right = (*M)[k][q];
            (*M)[k][p] = c * left - s * right;
            (*M)[k][q] = s * left + c * right;
          }
        for (std::size_t k = 0; k < n; ++k) {
          const Wide upper = S[p][k], lower = S[q][k];
          S[p][k] = c * upper - s * lower;
          S[q][k] = s * upper + c * lower;
        }
      }
    if (!turned) break;
  }
  std::array<Wide, 3> e{};
  for (std::size_t k = 0; k < n; ++k) e[k] = S[k][k];
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) {
      S[i][j] = 0;
      for (std::size_t k = 0; k < n; ++k)
        if (e[k] > 0) S[i][j] += e[k] * V[i][k] * V[j][k];
    }
}

/// Distance from the pair (P(z), P(z) - z) with z = x - y, which obeys the law of semidefinite matrices: sqrt(2) |x -
/// P(z)|. The 3 or 6 rows are the upper triangle, column by column, off-diagonals times sqrt(2).
Wide semidefinite_error(const WideRows& rows) {
  Wide trace = 0;
  for (std::size_t k = 0; k < rows.size; ++k) trace += rows.diagonal[k];
  const Wide a = trace > 0 ? trace / static_cast<Wide>(rows.size) : 1;
  const std::size_t order = rows.size == 3 ? 2 : 3;
  const Wide root = std::sqrt(Wide{2});
  std::array<std::array<Wide, 3>, 3> S{};
  for (std::size_t j = 0, k = 0; j < order; ++j)
    for (std::size_t i = 0; i <= j; ++i, ++k)
      S[i][j] = S[j][i] = (a * rows.lambda[k] - rows.w[k]) / (i == j ? 1 : root);
  project_matrix(S, order);
  Norm distance;
  for (std::size_t j = 0, k = 0; j < order; ++j)
    for (std::size_t i = 0; i <= j; ++i, ++k) distance.see(a * rows.lambda[k] - S[i][j] * (i == j ? 1 : root));
  return root * distance.value();
}

}  // namespace

double cone_error(const ConeRows& cone, ConeKind kind, Law law) {
  const WideRows rows(cone);
  for (std::size_t k = 0; k < rows.size; ++k)
    if (!std::isfinite(rows.lambda[k]) || !std::isfinite(rows.w[k]) || !std::isfinite(rows.diagonal[k]))
      return std::numeric_limits<double>::infinity();
  const Wide d = rows.diagonal[0];
  const auto lower = [d](Wide at) { return at <= -kBoundless ? -kInfinity : d * at; };
  const auto upper = [d](Wide at) { return at >= kBoundless ? kInfinity : d * at; };
  Wide error = kInfinity;
  switch (kind) {
    case ConeKind::free:
      error = std::abs(rows.w[0]);
      break;
    case ConeKind::unilateral:
      error = unilateral_error(d * rows.lambda[0], rows.w[0]);
      break;
    case ConeKind::box:
      if (!std::isnan(rows.lo) && !std::isnan(rows.hi))
        error = box_error(d * rows.lambda[0], rows.w[0], lower(rows.lo), upper(rows.hi));
      break;
    case ConeKind::friction:
    case ConeKind::box_friction:
      error = friction_error(rows, kind, law);
      break;
    case ConeKind::semidefinite:
      error = semidefinite_error(rows);
      break;
  }
  return static_cast<double>(finite_or_infinite(error));
}

}  // namespace stiction
