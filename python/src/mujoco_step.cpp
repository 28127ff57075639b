// Back into MuJoCo's structures, and the stages of its Runge-Kutta integrator.

#include <algorithm>
#include <cmath>
#include <cstring>

#include "python/src/mujoco.hpp"
#include "python/src/mujoco_memory.hpp"

namespace stiction::python {

namespace {

// mj_RungeKutta's tableau: stage i starts from the derivative of stage i - 1 alone, kPart of a step on.
constexpr double kPart[4] = {0.0, 0.5, 0.5, 1.0};
constexpr double kWeight[4] = {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};

/// Rate of the rotation vector u [rad] of an orientation that has turned by u and turns by w [rad/s], in body axes. It
/// is the inverse of the exponential's derivative (Munthe-Kaas 1998). Replaces w.
void correct_rotation(const double* u, double* w) {
  const double angle = std::sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
  const double half = 0.5 * angle;
  const double second = angle < 1e-4 ? 1.0 / 12.0 : (1.0 - half / std::tan(half)) / (angle * angle);
  const double first[3] = {u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]};
  const double twice[3] = {u[1] * first[2] - u[2] * first[1], u[2] * first[0] - u[0] * first[2],
                           u[0] * first[1] - u[1] * first[0]};
  for (int axis = 0; axis < 3; ++axis) w[axis] += 0.5 * first[axis] + second * twice[axis];
}

/// mjtConstraintState.
enum State : int { satisfied = 0, quadratic = 1, linear_negative = 2, linear_positive = 3, on_cone = 4 };

/// Distance from a cone's border at which a reaction still lies on it: a few roundings, from scaling and back.
constexpr double kBorder = 1 - 1e-9;

/// Returns the state of a cone's reaction, in the words of MuJoCo. It is without force, where force grows with the
/// square of the violation, or on the border of an elliptic cone. Or it is at the end of a friction loss (named by the
/// sign of J qacc - aref).
State state_of(ConeKind kind, std::size_t row, std::size_t rows, const MujocoSystem& system) {
  const double* force = system.lambda.data() + row;
  switch (kind) {
    case ConeKind::box:
      if (force[0] >= system.hi[row] * kBorder) return linear_negative;
      return force[0] <= system.lo[row] * kBorder ? linear_positive : quadratic;
    case ConeKind::unilateral:
      return force[0] > 0 ? quadratic : satisfied;
    case ConeKind::friction: {
      double tangent = 0;
      for (std::size_t k = 1; k < rows; ++k) {
        const double mu = system.mu[row + k];
        if (mu > 0) tangent += force[k] / mu * (force[k] / mu);
      }
      if (!(force[0] > 0)) return satisfied;
      return std::sqrt(tangent) >= force[0] * kBorder ? on_cone : quadratic;
    }
    default:
      return quadratic;
  }
}

/// States of one simulation's rows.
void write_states(const MujocoSystem& system, std::size_t env, int* state) {
  const auto first_row = system.env_row_offsets[env];
  for (Offset cone = system.env_cone_offsets[env]; cone < system.env_cone_offsets[env + 1]; ++cone) {
    const auto c = static_cast<std::size_t>(cone);
    const Offset row = system.cone_row_offsets[c];
    const Offset rows = system.cone_row_offsets[c + 1] - row;
    const State found = state_of(static_cast<ConeKind>(system.cone_kind[c]), static_cast<std::size_t>(row),
                                 static_cast<std::size_t>(rows), system);
    for (Offset k = 0; k < rows; ++k) state[row - first_row + k] = found;
  }
}

}  // namespace

void MujocoChunk::write_back(std::size_t env) {
  auto* data = static_cast<std::byte*>(data_[env]);
  const auto nv = static_cast<std::size_t>(layout_.nv);
  const auto row = system_.env_row_offsets[env];
  const auto rows = static_cast<std::size_t>(system_.env_row_offsets[env + 1] - row);
  auto* qacc = array_at<double>(data, layout_.qacc);
  auto* force = array_at<double>(data, layout_.qfrc_constraint);
  if (rows == 0) {
    std::memcpy(qacc, array_at<const double>(data, layout_.qacc_smooth), nv * sizeof(double));
    std::memset(force, 0, nv * sizeof(double));
    return;
  }
  const double* velocity = system_.velocity.data() + system_.env_dof_offsets[env];
  if (system_.mass_form == MassForm::matrix) {
    std::memcpy(qacc, velocity, nv * sizeof(double));
  } else {
    std::reverse_copy(velocity, velocity + nv, qacc);
  }
  auto* reactions = array_at<double>(data, layout_.efc_force);
  std::memcpy(reactions, system_.lambda.data() + row, rows * sizeof(double));
  write_states(system_, env, array_at<int>(data, layout_.efc_state));
  functions_.mul_jac_t_vec(model_, data, force, reactions);
}

void MujocoChunk::reset_warm_start(std::size_t simulation) {
  const auto env = static_cast<Offset>(simulation);
  if (store_) store_->reset({&env, 1});
  was_reset_[simulation] = starts_over_[simulation] = 1;
}

void MujocoChunk::rk4_begin(std::size_t env) {
  const auto nq = static_cast<std::size_t>(layout_.nq);
  const auto nv = static_cast<std::size_t>(layout_.nv);
  const auto* data = static_cast<const std::byte*>(data_[env]);
  RungeKutta& start = rk4_[env];
  const auto* qpos = array_at<const double>(data, layout_.qpos);
  const auto* qvel = array_at<const double>(data, layout_.qvel);
  start.time = number_at<double>(data, layout_.time);
  start.qpos.assign(qpos, qpos + nq);
  start.qvel.assign(qvel, qvel + nv);
  start.velocity.resize(5 * nv);
  start.acceleration.resize(5 * nv);
  rk4_leave(env, 0);
}

void MujocoChunk::rk4_leave(std::size_t env, int stage) {
  const auto nv = static_cast<std::size_t>(layout_.nv);
  const auto offset = static_cast<std::size_t>(stage) * nv;
  const auto* data = static_cast<const std::byte*>(data_[env]);
  double* velocity = rk4_[env].velocity.data() + offset;
  std::memcpy(velocity, array_at<const double>(data, layout_.qvel), nv * sizeof(double));
  std::memcpy(rk4_[env].acceleration.data() + offset, array_at<const double>(data, layout_.qacc), nv * sizeof(double));
  if (stage == 0) return;
  const double scale = layout_.timestep * kPart[stage];
  for (const Index first : layout_.rotations) {
    const double* before = velocity - nv + first;
    const double turned[3] = {scale * before[0], scale * before[1], scale * before[2]};
    correct_rotation(turned, velocity + first);
  }
}

void MujocoChunk::advance(std::size_t env, double dt) {
  auto* data = static_cast<std::byte*>(data_[env]);
  const RungeKutta& start = rk4_[env];
  const std::size_t sum = 4 * start.qvel.size();
  auto* qpos = array_at<double>(data, layout_.qpos);
  auto* qvel = array_at<double>(data, layout_.qvel);
  std::memcpy(qpos, start.qpos.data(), start.qpos.size() * sizeof(double));
  functions_.integrate_pos(model_, qpos, start.velocity.data() + sum, layout_.timestep);
  for (std::size_t dof = 0; dof < start.qvel.size(); ++dof)
    qvel[dof] = start.qvel[dof] + layout_.timestep * start.acceleration[sum + dof];
  const double time = start.time + dt;
  std::memcpy(data + layout_.time, &time, sizeof time);
}

void MujocoChunk::rk4_enter(std::size_t env, int stage) {
  RungeKutta& of = rk4_[env];
  const auto nv = static_cast<std::size_t>(layout_.nv);
  const auto offset = static_cast<std::size_t>(stage - 1) * nv;
  for (std::size_t dof = 0; dof < nv; ++dof) {
    of.velocity[4 * nv + dof] = kPart[stage] * of.velocity[offset + dof];
    of.acceleration[4 * nv + dof] = kPart[stage] * of.acceleration[offset + dof];
  }
  advance(env, kPart[stage] * layout_.timestep);
}

void MujocoChunk::rk4_end(std::size_t env) {
  RungeKutta& of = rk4_[env];
  const auto nv = static_cast<std::size_t>(layout_.nv);
  for (std::size_t dof = 0; dof < nv; ++dof) {
    double velocity = 0.0, acceleration = 0.0;
    for (std::size_t stage = 0; stage < 4; ++stage) {
      velocity += kWeight[stage] * of.velocity[stage * nv + dof];
      acceleration += kWeight[stage] * of.acceleration[stage * nv + dof];
    }
    of.velocity[4 * nv + dof] = velocity;
    of.acceleration[4 * nv + dof] = acceleration;
  }
  advance(env, layout_.timestep);
  auto* data = static_cast<std::byte*>(data_[env]);
  auto* qacc = array_at<double>(data, layout_.qacc);
  std::memcpy(array_at<double>(data, layout_.qacc_warmstart), qacc, nv * sizeof(double));
  std::memcpy(qacc, of.acceleration.data() + 4 * nv, nv * sizeof(double));
}

}  // namespace stiction::python
