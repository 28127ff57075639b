#include "stiction/world.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>
#include <utility>

#include "core/base/extents.hpp"
#include "core/base/fp_env.hpp"
#include "core/machine/world_machine.hpp"
#include "core/runtime/check/defects.hpp"
#include "core/runtime/check/expect.hpp"
#include "core/runtime/world/world_model.hpp"
#include "stiction/error.hpp"
#include "stiction/hash.hpp"

namespace stiction {

namespace {

/// Contacts that a step is to find again by number.
void check_remembered(const std::vector<Offset>& offsets, const std::vector<std::uint64_t>& ids, Offset env_count) {
  expect_length("from.contact_offsets", offsets.size(), at(env_count) + 1, "one more than there are environments");
  if (offsets.front() != 0) refuse("from.contact_offsets[0] = " + std::to_string(offsets.front()) + ": must be 0");
  for (std::size_t env = 0; env + 1 < offsets.size(); ++env)
    if (offsets[env + 1] < offsets[env])
      refuse("from.contact_offsets[" + std::to_string(env + 1) + "] = " + std::to_string(offsets[env + 1]) +
             ": must be at least the one before, " + std::to_string(offsets[env]));
  expect_length("from.contact_id", ids.size(), at(offsets.back()), "as many as from.contact_offsets ends with");
  for (std::size_t env = 0; env + 1 < offsets.size(); ++env)
    for (std::size_t c = at(offsets[env]) + 1; c < at(offsets[env + 1]); ++c)
      if (ids[c] <= ids[c - 1])
        refuse("from.contact_id[" + std::to_string(c) + "] = " + std::to_string(ids[c]) +
               ": must be above the one before in environment " + std::to_string(env) + ", " +
               std::to_string(ids[c - 1]));
}

/// Broken environments are data: the others go on.
BodySolverOptions isolating(BodySolverOptions options) {
  options.invalid = InvalidPolicy::isolate;
  return options;
}

template <class Real>
std::unique_ptr<WorldMachine<Real>> make_machine(Device device, const WorldModelView<Real>& model, Offset env_count,
                                                 const WorldOptions& options) {
  if (device.kind == DeviceKind::cuda) return make_cuda_world_machine(device.ordinal, model, env_count, options);
  if (device.kind == DeviceKind::emulated) return make_emulated_world_machine(model, env_count, options);
  return make_cpu_world_machine(model, env_count, options);
}

/// Adds the time between its birth and its death.
class Stopwatch {
 public:
  explicit Stopwatch(double& total) : total_(total) {}
  ~Stopwatch() { total_ += std::chrono::duration<double>(Clock::now() - start_).count(); }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

 private:
  using Clock = std::chrono::steady_clock;
  double& total_;
  Clock::time_point start_ = Clock::now();
};

}  // namespace

template <class Real>
struct World<Real>::Parts {
  Parts(Device device, WorldDescription what, Offset envs, const WorldOptions& how)
      : description(std::move(what)),
        options(how),
        env_count(envs),
        body_count(static_cast<Index>(description.bodies.size())),
        solver(device, how.stepping, isolating(how.solver)),
        model(description, how),
        machine(make_machine(device, model.view(), envs, options)) {
    const std::vector<std::uint8_t> all(at(envs), 1);
    put_initial(all);
  }

  void put_initial(std::span<const std::uint8_t> mask) {
    WorldArrays<Real>& now = machine->observe(WorldPart::state);
    for (Offset env = 0; env < env_count; ++env)
      for (Index body = 0; mask[at(env)] != 0 && body < body_count; ++body) {
        const WorldBody& from = description.bodies[at(body)];
        const Offset place = env * body_count + body;
        std::copy(from.position.begin(), from.position.end(), now.position.begin() + 3 * place);
        std::copy(from.twist.begin(), from.twist.end(), now.twist.begin() + 6 * place);
        put_unit(from.orientation, now.orientation.data() + 4 * place);
      }
    machine->restart(mask);
  }

  [[nodiscard]] WorldSolve<Real> find_contacts() {
    const Stopwatch watch(seconds.detect);
    return machine->find_contacts();
  }

  [[nodiscard]] BodyPlan plan(const WorldSolve<Real>& what) {
    const Stopwatch watch(seconds.plan);
    return solver.plan(what.structure);
  }

  template <class F>
  void solve(F&& answer) {
    const Stopwatch watch(seconds.solve);
    answer();
    machine->await_solve();
  }

  /// For contacts that were found, but whose impulses were not written.
  void forget_contacts() {
    static_cast<void>(machine->observe(WorldPart::state));
    machine->restart(std::vector<std::uint8_t>(at(env_count), 1));
  }

  void integrate() {
    const Stopwatch watch(seconds.integrate);
    machine->integrate();
  }

  WorldDescription description;
  WorldOptions options;
  Offset env_count;
  Index body_count;
  BodySolver solver;
  WorldModel<Real> model;
  std::unique_ptr<WorldMachine<Real>> machine;
  WorldSeconds seconds;
};

template <class Real>
World<Real>::World(Device device, WorldDescription description, Offset env_count, const WorldOptions& options) {
  const ScopedFpEnv fp_env;
  check_description(description);
  check_world_options(options);
  if (env_count < 0) refuse("env_count = " + std::to_string(env_count) + ": must be >= 0");
  parts_ = std::make_unique<Parts>(device, std::move(description), env_count, options);
}
template <class Real>
World<Real>::~World() = default;
template <class Real>
World<Real>::World(World&&) noexcept = default;
template <class Real>
World<Real>& World<Real>::operator=(World&&) noexcept = default;

template <class Real>
void World<Real>::step() {
  const ScopedFpEnv fp_env;
  const WorldSolve<Real> solve = parts_->find_contacts();
  const BodyPlan plan = parts_->plan(solve);
  parts_->solve([&] { parts_->solver.solve(plan, solve.batch, solve.solution, solve.guess, solve.stream); });
  parts_->integrate();
}

template <class Real>
void World<Real>::step(const StepSolver<Real>& solve) {
  if (!solve) refuse("solve is empty: give a function, or call step() without one");
  const ScopedFpEnv fp_env;
  const WorldSolve<Real> found = parts_->find_contacts();
  parts_->machine->await_solve();
  try {
    parts_->solve([&] { solve(found.batch, found.solution, found.guess); });
  } catch (...) {
    parts_->forget_contacts();
    throw;
  }
  parts_->integrate();
}

template <class Real>
WorldState<Real> World<Real>::state() const {
  const WorldArrays<Real>& now = parts_->machine->observe(WorldPart::state);
  return {now.position, now.orientation, now.twist};
}

template <class Real>
std::span<Real> World<Real>::wrench() {
  return parts_->machine->wrench();
}

template <class Real>
void World<Real>::reset(std::span<const std::uint8_t> mask, const WorldState<Real>& state) {
  const ScopedFpEnv fp_env;
  Parts& parts = *parts_;
  const std::size_t bodies = at(parts.env_count) * at(parts.body_count);
  expect_length("mask", mask.size(), at(parts.env_count), "one byte per environment");
  expect_length("state.position", state.position.size(), 3 * bodies, "three numbers per body");
  expect_length("state.orientation", state.orientation.size(), 4 * bodies, "four numbers per body");
  expect_length("state.twist", state.twist.size(), 6 * bodies, "six numbers per body");
  const auto finite = [](std::span<const Real> values) {
    return std::all_of(values.begin(), values.end(), [](Real value) { return std::isfinite(value); });
  };
  const auto of_body = [](std::span<const Real> values, Offset place, std::size_t width) {
    return values.subspan(at(place) * width, width);
  };
  const auto for_each_body = [&](auto&& f) {
    for (Offset env = 0; env < parts.env_count; ++env)
      for (Index body = 0; mask[at(env)] != 0 && body < parts.body_count; ++body) f(env, env * parts.body_count + body);
  };
  for_each_body([&](Offset env, Offset place) {
    const auto q = of_body(state.orientation, place, 4);
    const bool has_length = std::any_of(q.begin(), q.end(), [](Real value) { return value != Real(0); });
    if (!has_length || !finite(q) || !finite(of_body(state.position, place, 3)) ||
        !finite(of_body(state.twist, place, 6)))
      refuse("state of environment " + std::to_string(env) + ", body " +
             std::to_string(place - env * parts.body_count) + " has a number that is not finite or a zero quaternion");
  });
  WorldArrays<Real>& now = parts.machine->observe(WorldPart::state);
  for_each_body([&](Offset, Offset place) {
    const auto position = of_body(state.position, place, 3);
    const auto twist = of_body(state.twist, place, 6);
    const auto q = of_body(state.orientation, place, 4);
    std::copy(position.begin(), position.end(), now.position.begin() + 3 * place);
    std::copy(twist.begin(), twist.end(), now.twist.begin() + 6 * place);
    put_unit(
        {static_cast<double>(q[0]), static_cast<double>(q[1]), static_cast<double>(q[2]), static_cast<double>(q[3])},
        now.orientation.data() + 4 * place);
  });
  parts.machine->restart(mask);
}

template <class Real>
void World<Real>::reset(std::span<const std::uint8_t> mask) {
  expect_length("mask", mask.size(), at(parts_->env_count), "one byte per environment");
  parts_->put_initial(mask);
}

template <class Real>
WorldCheckpoint<Real> World<Real>::checkpoint() const {
  WorldMachine<Real>& machine = *parts_->machine;
  WorldCheckpoint<Real> now;
  const WorldArrays<Real>& state = machine.observe(WorldPart::state);
  now.position = state.position;
  now.orientation = state.orientation;
  now.twist = state.twist;
  now.wrench = state.wrench;
  const HostContacts<Real>& contacts = machine.observe(WorldPart::contacts).contacts;
  now.contact_offsets = contacts.offsets;
  now.contact_id = contacts.id;
  now.impulse = contacts.impulse;
  return now;
}

template <class Real>
void World<Real>::resume(const WorldCheckpoint<Real>& from) {
  const std::size_t bodies = at(parts_->env_count) * at(parts_->body_count);
  expect_length("from.position", from.position.size(), 3 * bodies, "three numbers per body");
  expect_length("from.orientation", from.orientation.size(), 4 * bodies, "four numbers per body");
  expect_length("from.twist", from.twist.size(), 6 * bodies, "six numbers per body");
  expect_length("from.wrench", from.wrench.size(), 6 * bodies, "six numbers per body");
  check_remembered(from.contact_offsets, from.contact_id, parts_->env_count);
  expect_length("from.impulse", from.impulse.size(), 3 * from.contact_id.size(), "three numbers per contact");
  parts_->machine->resume(from);
}

template <class Real>
std::span<const EnvStatus> World<Real>::status() const {
  return parts_->machine->observe(WorldPart::status).status;
}
template <class Real>
std::span<const Offset> World<Real>::contact_offsets() const {
  return parts_->machine->observe(WorldPart::status).contacts.offsets;
}
template <class Real>
BodyBatchView<Real> World<Real>::contacts() const {
  return parts_->machine->observe(WorldPart::contacts).batch();
}
template <class Real>
std::span<const Real> World<Real>::impulses() const {
  return parts_->machine->observe(WorldPart::contacts).contacts.impulse;
}

template <class Real>
std::vector<WorldMotion> World<Real>::motion() const {
  const ScopedFpEnv fp_env;
  std::vector<WorldMotion> motion(at(parts_->env_count));
  parts_->machine->motion(motion);
  return motion;
}

template <class Real>
std::uint64_t World<Real>::hash() const {
  const WorldState<Real> now = state();
  std::vector<Real> all(now.position.begin(), now.position.end());
  all.insert(all.end(), now.orientation.begin(), now.orientation.end());
  all.insert(all.end(), now.twist.begin(), now.twist.end());
  return hash_bits(std::span<const Real>(all));
}

template <class Real>
const WorldSeconds& World<Real>::seconds() const {
  return parts_->seconds;
}
template <class Real>
Offset World<Real>::env_count() const {
  return parts_->env_count;
}
template <class Real>
Index World<Real>::body_count() const {
  return parts_->body_count;
}
template <class Real>
const WorldDescription& World<Real>::description() const {
  return parts_->description;
}
template <class Real>
const WorldOptions& World<Real>::options() const {
  return parts_->options;
}

template class World<float>;
template class World<double>;

}  // namespace stiction
