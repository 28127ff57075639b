#include "stiction/jacobian_bodies.hpp"

#include <array>
#include <cmath>
#include <string>

#include "core/base/fp_env.hpp"
#include "core/machine/jacobian_machine.hpp"
#include "core/runtime/check/expect.hpp"

namespace stiction {

namespace {

using Vector = std::array<double, 3>;
using Twist = std::array<double, 6>;
using Block = std::array<Twist, 6>;

constexpr Index kBodyDofs = 6;

double dot(const Vector& a, const Vector& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// One environment of a batch, whose structure is sound.
template <class Real>
class BodyFinder {
 public:
  BodyFinder(const JacobianBatchView<Real>& batch, Offset env) : batch_(batch), env_(env) {}

  BodyEnvironment<Real> find(double R, std::vector<double>& tangents) {
    const Index dofs = batch_.env_dofs(env_);
    if (dofs % kBodyDofs != 0)
      refuse("has " + std::to_string(dofs) + " degrees of freedom, which bodies of 6 do not tile");
    for (Index body = 0; body < dofs / kBodyDofs; ++body) add_body(body);
    for (Index cone = 0; cone < batch_.env_cones(env_); ++cone) add_contact(cone, R, tangents);
    return found_;
  }

 private:
  /// Rounding that recorded numbers may have, of their own size.
  static constexpr double kRounding = sizeof(Real) == sizeof(float) ? 1e-5 : 1e-9;

  [[noreturn]] void refuse(const std::string& what) const {
    throw Error(ErrorCode::unsupported, "environment " + std::to_string(env_) + ": " + what +
                                            "; as_bodies() takes free rigid bodies in world axes: solve it as J and M");
  }
  static bool is_near(double a, double b, double scale) { return std::abs(a - b) <= kRounding * scale; }

  /// An entry of the lower triangle of M, or of its factor.
  [[nodiscard]] double stored(Index row, Index column) const {
    const Index block = batch_.mass_block == 0 ? batch_.env_dofs(env_) : batch_.mass_block;
    if (row < column || row / block != column / block) return 0.0;
    return static_cast<double>(batch_.M[batch_.env_mass_offsets[env_] + Offset{row} * block + column % block]);
  }
  /// M between two degrees of freedom of one body, which nothing couples with another.
  [[nodiscard]] double mass(Index row, Index column) const {
    if (batch_.mass_form == MassForm::matrix) return row >= column ? stored(row, column) : stored(column, row);
    double sum = 0.0;
    for (Index k = row - row % kBodyDofs; k <= row; ++k) sum += stored(row, k) * stored(column, k);
    return sum;
  }

  /// Returns true if M has no entry between bodies by its form.
  [[nodiscard]] bool is_in_blocks() const { return batch_.mass_block > 0 && kBodyDofs % batch_.mass_block == 0; }

  void add_body(Index body) {
    const Index first = body * kBodyDofs;
    const auto fail = [&](const std::string& what) { refuse("body " + std::to_string(body) + " " + what); };
    const auto at = [&](Index i, Index j) { return mass(first + i, first + j); };
    const double own = at(0, 0);
    double inertia_size = 0.0;
    for (Index i = 3; i < kBodyDofs; ++i)
      if (at(i, i) > inertia_size) inertia_size = at(i, i);
    if (!(own > 0.0) || !(inertia_size > 0.0)) fail("has no positive mass and inertia");
    for (Index i = 0; i < kBodyDofs; ++i)
      for (Index j = 0; j < i; ++j)
        if (j < 3 && !is_near(at(i, j), 0.0, std::sqrt(at(i, i) * at(j, j))))
          fail("couples velocity and spin, or axes of velocity, in M");
    for (Index i = 1; i < 3; ++i)
      if (!is_near(at(i, i), own, own)) fail("has different masses along its axes");
    for (Index row = first; row < first + kBodyDofs; ++row)
      for (Index column = 0; column < first && !is_in_blocks(); ++column)
        if (stored(row, column) != 0.0) fail("is coupled with another in M");
    auto& added = found_.bodies.emplace_back();
    added.inv_mass = static_cast<Real>(1.0 / own);
    add_inverse_inertia(added, {at(3, 3), at(4, 3), at(5, 3), at(4, 4), at(5, 4), at(5, 5)});
    for (Index i = 0; i < kBodyDofs; ++i)
      added.twist_change[static_cast<std::size_t>(i)] = batch_.v_free[batch_.env_dof_offsets[env_] + first + i];
  }

  /// Inverts xx, xy, xz, yy, yz, zz by cofactors.
  static void add_inverse_inertia(typename BodyEnvironment<Real>::Body& body, const std::array<double, 6>& m) {
    const auto [xx, xy, xz, yy, yz, zz] = m;
    const std::array<double, 6> cofactors{yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy,
                                          xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy};
    const double determinant = xx * cofactors[0] + xy * cofactors[1] + xz * cofactors[2];
    for (std::size_t k = 0; k < 6; ++k) body.inv_inertia[k] = static_cast<Real>(cofactors[k] / determinant);
  }

  /// A body in the rows of a cone: n, t1, t2.
  struct Side {
    Index body = -1;
    std::array<Twist, 3> rows{};
  };

  void add_contact(Index cone, double R, std::vector<double>& tangents) {
    const Offset at = batch_.env_cone_offsets[env_] + cone;
    const Offset first = batch_.cone_row_offsets[at], end = batch_.cone_row_offsets[at + 1];
    const auto fail = [&](const std::string& what) { refuse("cone " + std::to_string(cone) + " " + what); };
    if (batch_.cone_kind[at] != ConeKind::friction || end - first != 3)
      fail("is no friction cone of a normal and two tangential rows");
    const double mu = static_cast<double>(batch_.mu[first + 1]);
    if (!is_near(static_cast<double>(batch_.mu[first + 2]), mu, mu)) fail("has two frictions");
    for (Offset row = first; row < end; ++row) {
      if (!is_near(static_cast<double>(batch_.R[row]), R, R)) fail("has another R than the first row of the batch");
      if (row > first && batch_.target != nullptr && batch_.target[row] != Real(0)) fail("has a tangential target");
    }
    const std::vector<Side> sides = sides_of(first);
    if (sides.empty() || sides.size() > 2) fail("touches " + std::to_string(sides.size()) + " bodies, not one or two");
    const Side& b = sides.back();
    std::array<Vector, 3> axes{};
    for (std::size_t k = 0; k < 3; ++k) axes[k] = {b.rows[k][0], b.rows[k][1], b.rows[k][2]};
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t j = 0; j <= k; ++j)
        if (!is_near(dot(axes[k], axes[j]), j == k ? 1.0 : 0.0, 1.0)) fail("has rows that are no orthogonal axes");
    auto& contact = found_.contacts.emplace_back();
    contact.body_b = b.body;
    contact.mu = static_cast<Real>(mu);
    contact.depth = batch_.target == nullptr ? Real(0) : batch_.target[first];
    for (std::size_t k = 0; k < 3; ++k) contact.normal[k] = static_cast<Real>(axes[0][k]);
    if (!find_arm(b, axes, 1.0, contact.arm_b)) fail("is no point of body " + std::to_string(b.body));
    if (sides.size() == 2) {
      contact.body_a = sides.front().body;
      if (!find_arm(sides.front(), axes, -1.0, contact.arm_a))
        fail("is no point of body " + std::to_string(contact.body_a) + " against body " + std::to_string(b.body));
    }
    add_tangents(axes, tangents);
  }

  /// The bodies that three rows touch, in the order of their numbers.
  [[nodiscard]] std::vector<Side> sides_of(Offset first) const {
    std::vector<Side> sides;
    for (std::size_t k = 0; k < 3; ++k) {
      const Offset from = batch_.row_offsets[first + static_cast<Offset>(k)];
      const Offset to = batch_.column == nullptr ? from + batch_.env_dofs(env_)
                                                 : batch_.row_offsets[first + static_cast<Offset>(k) + 1];
      for (Offset e = from; e < to; ++e) {
        if (batch_.J[e] == Real(0)) continue;
        const Index dof = batch_.column == nullptr ? static_cast<Index>(e - from) : batch_.column[e];
        auto side = sides.begin();
        while (side != sides.end() && side->body < dof / kBodyDofs) ++side;
        if (side == sides.end() || side->body != dof / kBodyDofs) side = sides.insert(side, Side{dof / kBodyDofs, {}});
        side->rows[k][static_cast<std::size_t>(dof % kBodyDofs)] += static_cast<double>(batch_.J[e]);
      }
    }
    return sides;
  }

  /// The arm r for which each row is sign (e, r x e). The sum of e x (r x e) over three axes is 2 r.
  static bool find_arm(const Side& side, const std::array<Vector, 3>& axes, double sign, std::array<Real, 3>& arm) {
    Vector sum{};
    for (std::size_t k = 0; k < 3; ++k) {
      const Vector turned = cross(axes[k], {side.rows[k][3], side.rows[k][4], side.rows[k][5]});
      for (std::size_t i = 0; i < 3; ++i) sum[i] += 0.5 * sign * turned[i];
    }
    const double size = 1.0 + std::sqrt(dot(sum, sum));
    for (std::size_t k = 0; k < 3; ++k) {
      const Vector turned = cross(sum, axes[k]);
      for (std::size_t i = 0; i < 3; ++i)
        if (!is_near(side.rows[k][i], sign * axes[k][i], 1.0) || !is_near(side.rows[k][3 + i], sign * turned[i], size))
          return false;
    }
    for (std::size_t i = 0; i < 3; ++i) arm[i] = static_cast<Real>(sum[i]);
    return true;
  }

  static void add_tangents(const std::array<Vector, 3>& axes, std::vector<double>& tangents) {
    const double n[3] = {axes[0][0], axes[0][1], axes[0][2]};
    double t1[3], t2[3];
    contact_tangents(n, t1, t2);
    for (std::size_t k = 1; k < 3; ++k)
      for (const auto& t : {t1, t2}) tangents.push_back(dot(axes[k], {t[0], t[1], t[2]}));
  }

  const JacobianBatchView<Real>& batch_;
  Offset env_;
  BodyEnvironment<Real> found_;
};

/// by_contact or its inverse: the normal stays, tangential numbers are multiplied by the matrix or its transpose.
template <class Real>
std::vector<Real> turned(const JacobianBodies<Real>& bodies, std::span<const Real> from, bool transposed,
                         const char* name) {
  expect_length(name, from.size(), 3 * static_cast<std::size_t>(bodies.batch.contact_count()), "three per contact");
  std::vector<Real> to(from.begin(), from.end());
  for (std::size_t c = 0; 3 * c < from.size(); ++c)
    for (std::size_t i = 0; i < 2; ++i) {
      double sum = 0.0;
      for (std::size_t j = 0; j < 2; ++j)
        sum += bodies.tangents[4 * c + (transposed ? 2 * j + i : 2 * i + j)] * static_cast<double>(from[3 * c + 1 + j]);
      to[3 * c + 1 + i] = static_cast<Real>(sum);
    }
  return to;
}

}  // namespace

template <class Real>
JacobianBodies<Real> as_bodies(const JacobianBatchView<Real>& batch) {
  const ScopedFpEnv fp_env;
  if (batch.space != MemorySpace::host) refuse("batch.space is not the host's: as_bodies() reads host memory");
  check_structure(batch);
  JacobianBodies<Real> bodies;
  bodies.stepping.dt = 1.0;
  bodies.stepping.erp = 1.0;
  for (Offset env = 0; env < batch.env_count; ++env) {
    // Rows of the batch have one R: that of the first environment that has any.
    if (bodies.tangents.empty() && batch.env_rows(env) > 0)
      bodies.stepping.cfm = static_cast<double>(batch.R[batch.env_row_offsets[env]]);
    bodies.batch.add(BodyFinder<Real>(batch, env).find(bodies.stepping.cfm, bodies.tangents));
  }
  return bodies;
}

template <class Real>
std::vector<Real> to_rows(const JacobianBodies<Real>& bodies, std::span<const Real> by_contact) {
  return turned(bodies, by_contact, false, "by_contact");
}
template <class Real>
std::vector<Real> to_contacts(const JacobianBodies<Real>& bodies, std::span<const Real> by_row) {
  return turned(bodies, by_row, true, "by_row");
}

template JacobianBodies<float> as_bodies(const JacobianBatchView<float>&);
template JacobianBodies<double> as_bodies(const JacobianBatchView<double>&);
template std::vector<float> to_rows(const JacobianBodies<float>&, std::span<const float>);
template std::vector<double> to_rows(const JacobianBodies<double>&, std::span<const double>);
template std::vector<float> to_contacts(const JacobianBodies<float>&, std::span<const float>);
template std::vector<double> to_contacts(const JacobianBodies<double>&, std::span<const double>);

}  // namespace stiction
