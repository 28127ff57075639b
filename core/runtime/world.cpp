#include "stiction/world.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>

#include "core/base/extents.hpp"
#include "core/runtime/defects.hpp"
#include "core/runtime/expect.hpp"
#include "core/runtime/world_machine.hpp"
#include "core/runtime/world_model.hpp"
#include "stiction/error.hpp"
#include "stiction/hash.hpp"

namespace stiction {

namespace {

void check_world_options(const WorldOptions& options) {
  if (options.solver.substeps != 1)
    refuse("solver.substeps = " + std::to_string(options.solver.substeps) +
           ": must be 1: a world detects contacts in every step; take a smaller stepping.dt");
  if (!(options.margin >= 0) || !std::isfinite(options.margin))
    refuse("margin = " + shortest_text(options.margin) + ": must be finite and >= 0");
  if (!(options.warm_start >= 0 && options.warm_start <= 1))
    refuse("warm_start = " + shortest_text(options.warm_start) + ": must be in [0, 1]");
}

/// Broken environments are data: the others go on.
BodySolverOptions isolating(BodySolverOptions options) {
  options.invalid = InvalidPolicy::isolate;
  return options;
}

/// The contacts of one step, in the arrays of a BodyBatchView, and what they ended with.
template <class Real>
struct StepContacts {
  std::vector<Offset> offsets;
  std::vector<Index> body_a, body_b;
  std::vector<Real> arm_a, arm_b, normal, mu, depth, restitution, guess, impulse;
  std::vector<std::uint64_t> id;

  void resize(std::size_t count) {
    for (auto* array : {&body_a, &body_b}) array->resize(count);
    for (auto* array : {&arm_a, &arm_b, &normal, &guess, &impulse}) array->resize(3 * count);
    for (auto* array : {&mu, &depth, &restitution}) array->resize(count);
    id.resize(count);
  }
};

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
        machine(make_cpu_world<Real>(envs, how.solver.threads)),
        model(description, how) {
    const std::size_t bodies = at(env_count) * at(body_count);
    position.resize(3 * bodies);
    orientation.resize(4 * bodies);
    for (auto* array : {&twist, &solved_twist, &twist_change, &inv_inertia, &wrench})
      array->assign(6 * bodies, Real(0));
    inv_mass.resize(bodies);
    status.resize(at(env_count));
    body_offsets.resize(at(env_count) + 1);
    for (Offset env = 0; env <= env_count; ++env) body_offsets[at(env)] = env * body_count;
    for (std::size_t body = 0; body < bodies; ++body)
      inv_mass[body] = model.view().body[body % at(body_count)].inv_mass;
    now.offsets.assign(at(env_count) + 1, 0);
    last.offsets = now.offsets;
    for (Offset env = 0; env < env_count; ++env) put_initial(env);
  }

  void put_initial(Offset env) {
    for (Index body = 0; body < body_count; ++body) {
      const WorldBody& from = description.bodies[at(body)];
      const Offset place = env * body_count + body;
      std::copy(from.position.begin(), from.position.end(), position.begin() + 3 * place);
      std::copy(from.twist.begin(), from.twist.end(), twist.begin() + 6 * place);
      put_orientation(place, from.orientation);
    }
  }

  /// Normalises in double. Returns whether it could.
  bool put_orientation(Offset place, const std::array<double, 4>& q) {
    const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!(norm > 0) || !std::isfinite(norm)) return false;
    for (std::size_t k = 0; k < 4; ++k) orientation[4 * at(place) + k] = static_cast<Real>(q[k] / norm);
    return true;
  }

  /// Its contacts' impulses are not the next step's first guess.
  void forget(Offset env) {
    std::fill(now.impulse.begin() + 3 * now.offsets[at(env)], now.impulse.begin() + 3 * now.offsets[at(env) + 1],
              Real(0));
  }

  WorldJob<Real> job() {
    return {model.view(),       position.data(),     orientation.data(),  twist.data(), wrench.data(),
            inv_inertia.data(), twist_change.data(), solved_twist.data(), status.data()};
  }

  [[nodiscard]] BodyBatchView<Real> batch() const {
    BodyBatchView<Real> view;
    view.env_count = env_count;
    view.body_count = body_offsets.back();
    view.contact_count = now.offsets.back();
    view.env_body_offsets = body_offsets.data();
    view.env_contact_offsets = now.offsets.data();
    view.inv_mass = inv_mass.data();
    view.inv_inertia = inv_inertia.data();
    view.twist = twist.data();
    view.twist_change = twist_change.data();
    view.body_a = now.body_a.data();
    view.body_b = now.body_b.data();
    view.arm_a = now.arm_a.data();
    view.arm_b = now.arm_b.data();
    view.normal = now.normal.data();
    view.mu = now.mu.data();
    view.depth = now.depth.data();
    view.restitution = now.restitution.data();
    view.contact_id = now.id.data();
    return view;
  }

  void find_contacts() {
    const Stopwatch watch(seconds.detect);
    std::swap(now, last);
    now.offsets[0] = 0;
    machine->find_contacts(job(), std::span<Offset>(now.offsets).subspan(1));
    std::partial_sum(now.offsets.begin(), now.offsets.end(), now.offsets.begin());
    now.resize(at(now.offsets.back()));
    ContactSink<Real> sink{now.offsets.data(), now.body_a.data(),   now.body_b.data(),
                           now.arm_a.data(),   now.arm_b.data(),    now.normal.data(),
                           now.mu.data(),      now.depth.data(),    now.restitution.data(),
                           now.id.data(),      now.guess.data(),    nullptr,
                           last.id.data(),     last.impulse.data(), static_cast<Real>(options.warm_start)};
    if (options.warm_start > 0) sink.last_offsets = last.offsets.data();
    machine->hand_over(job(), sink);
  }

  [[nodiscard]] BodyPlan plan() {
    const Stopwatch watch(seconds.plan);
    return solver.plan(batch());
  }

  void solve(const BodyPlan& order) {
    const Stopwatch watch(seconds.solve);
    const BodySolutionView<Real> solution{now.impulse.data(), solved_twist.data(), nullptr, status.data()};
    solver.solve(order, batch(), solution, options.warm_start > 0 ? now.guess.data() : nullptr);
  }

  void integrate() {
    const Stopwatch watch(seconds.integrate);
    machine->integrate(job());
  }

  WorldDescription description;
  WorldOptions options;
  Offset env_count;
  Index body_count;
  BodySolver solver;
  std::unique_ptr<WorldMachine<Real>> machine;
  WorldModel<Real> model;
  std::vector<Real> position, orientation, twist, solved_twist, twist_change, inv_inertia, inv_mass, wrench;
  std::vector<Offset> body_offsets;
  std::vector<EnvStatus> status;
  StepContacts<Real> now, last;
  WorldSeconds seconds;
};

template <class Real>
World<Real>::World(Device device, WorldDescription description, Offset env_count, const WorldOptions& options) {
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
  parts_->find_contacts();
  const BodyPlan plan = parts_->plan();
  parts_->solve(plan);
  parts_->integrate();
}

template <class Real>
WorldState<Real> World<Real>::state() const {
  return {parts_->position, parts_->orientation, parts_->twist};
}

template <class Real>
std::span<Real> World<Real>::wrench() {
  return parts_->wrench;
}

template <class Real>
void World<Real>::reset(std::span<const std::uint8_t> mask, const WorldState<Real>& state) {
  Parts& parts = *parts_;
  const std::size_t bodies = parts.inv_mass.size();
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
  for_each_body([&](Offset, Offset place) {
    const auto position = of_body(state.position, place, 3);
    const auto twist = of_body(state.twist, place, 6);
    const auto q = of_body(state.orientation, place, 4);
    std::copy(position.begin(), position.end(), parts.position.begin() + 3 * place);
    std::copy(twist.begin(), twist.end(), parts.twist.begin() + 6 * place);
    parts.put_orientation(place, {static_cast<double>(q[0]), static_cast<double>(q[1]), static_cast<double>(q[2]),
                                  static_cast<double>(q[3])});
  });
  for (Offset env = 0; env < parts.env_count; ++env)
    if (mask[at(env)] != 0) parts.forget(env);
}

template <class Real>
void World<Real>::reset(std::span<const std::uint8_t> mask) {
  expect_length("mask", mask.size(), at(parts_->env_count), "one byte per environment");
  for (Offset env = 0; env < parts_->env_count; ++env) {
    if (mask[at(env)] == 0) continue;
    parts_->put_initial(env);
    parts_->forget(env);
  }
}

template <class Real>
std::span<const EnvStatus> World<Real>::status() const {
  return parts_->status;
}
template <class Real>
std::span<const Offset> World<Real>::contact_offsets() const {
  return parts_->now.offsets;
}
template <class Real>
BodyBatchView<Real> World<Real>::contacts() const {
  return parts_->batch();
}
template <class Real>
std::span<const Real> World<Real>::impulses() const {
  return parts_->now.impulse;
}

template <class Real>
std::vector<WorldMotion> World<Real>::motion() const {
  std::vector<WorldMotion> motion(at(parts_->env_count));
  parts_->machine->motion(parts_->job(), motion);
  return motion;
}

template <class Real>
std::uint64_t World<Real>::hash() const {
  std::vector<Real> all(parts_->position);
  all.insert(all.end(), parts_->orientation.begin(), parts_->orientation.end());
  all.insert(all.end(), parts_->twist.begin(), parts_->twist.end());
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
