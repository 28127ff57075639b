#include <optional>

#include "core/job/body_job.hpp"
#include "stiction/bodies.hpp"
#include "stiction/error.hpp"
#include "tests/fuzz/checks.hpp"
#include "tests/fuzz/numbers.hpp"
#include "tests/fuzz/promises.hpp"

namespace stiction::fuzz {
namespace {

template <class Real>
BodyEnvironment<Real> sound_environment(Bytes& bytes) {
  BodyEnvironment<Real> environment;
  environment.bodies.resize(static_cast<std::size_t>(1 + bytes.below(4)));
  const auto bodies = static_cast<int>(environment.bodies.size());
  for (auto& body : environment.bodies) {
    body.inv_mass = Real(0.5) + share<Real>(bytes);
    for (Real& value : body.twist) value = tame<Real>(bytes);
    for (Real& value : body.twist_change) value = tame<Real>(bytes) / 16;
  }
  environment.bodies.back().kinematic = bytes.once_in(8);
  environment.contacts.resize(static_cast<std::size_t>(bytes.below(6)));
  for (auto& contact : environment.contacts) {
    contact.body_a = bytes.below(bodies + 1) - 1;
    contact.body_b = bytes.below(bodies);
    if (contact.body_a == contact.body_b) contact.body_a = -1;
    for (Real& value : contact.arm_a) value = tame<Real>(bytes) / 8;
    for (Real& value : contact.arm_b) value = tame<Real>(bytes) / 8;
    contact.normal = {0, 0, 0};
    contact.normal[static_cast<std::size_t>(bytes.below(3))] = bytes.once_in(2) ? Real(-1) : Real(1);
    contact.mu = share<Real>(bytes);
    contact.depth = tame<Real>(bytes) / 64;
    contact.restitution = share<Real>(bytes);
  }
  return environment;
}

template <class Real>
void spoil(BodyEnvironment<Real>& environment, Bytes& bytes) {
  for (int edits = bytes.below(8); edits > 0; --edits) {
    auto& body = environment.bodies[bytes.byte() % environment.bodies.size()];
    const auto at = static_cast<std::size_t>(bytes.below(6));
    Real* numbers[] = {&body.inv_mass, &body.inv_inertia[at], &body.twist[at], &body.twist_change[at]};
    *bytes.one_of(numbers) = wild<Real>(bytes);
    if (environment.contacts.empty()) continue;
    auto& contact = environment.contacts[bytes.byte() % environment.contacts.size()];
    const std::size_t axis = at % 3;
    Real* others[] = {&contact.arm_a[axis], &contact.arm_b[axis], &contact.normal[axis],
                      &contact.mu,          &contact.depth,       &contact.restitution};
    *bytes.one_of(others) = wild<Real>(bytes);
  }
}

BodySolverOptions body_options(Bytes& bytes) {
  constexpr double kTolerances[] = {0, 1e-4, 1e-10, 0.5};
  constexpr double kOmegas[] = {1, 0.25, 1.5};
  BodySolverOptions options;
  const auto law = static_cast<Law>(bytes.below(kContactLaws));
  options.box_friction = law == kBoxFriction;
  if (!options.box_friction) options.law = law;
  options.method = static_cast<BodyMethod>(bytes.below(2));
  options.space.preconditioner = static_cast<BodyPreconditioner>(bytes.below(kBodyPreconditionerCount));
  options.space.multigrid.prolongation = static_cast<Prolongation>(bytes.below(2));
  options.space.multigrid.cycle = bytes.once_in(2) ? Cycle::w : Cycle::v;
  options.iterations = bytes.below(12);
  options.tolerance = bytes.one_of(kTolerances);
  options.momentum = bytes.once_in(2);
  options.omega = bytes.one_of(kOmegas);
  options.substeps = 1 + bytes.below(3);
  options.max_contacts_per_env = bytes.once_in(4) ? 2 : 0;
  options.blocks = options.method == BodyMethod::impulses && bytes.once_in(4) ? BlockMode::pairs : BlockMode::cones;
  options.threads = 1;
  options.invalid = InvalidPolicy::isolate;
  return options;
}

TimeStepping time_stepping(Bytes& bytes) {
  TimeStepping stepping;
  stepping.slop = bytes.once_in(4) ? 0.001 : 0;
  stepping.cfm = bytes.once_in(4) ? 1e-3 : 0;
  return stepping;
}

template <class Real>
std::optional<BodySolution<Real>> solved(const std::vector<BodyEnvironment<Real>>& all, const TimeStepping& stepping,
                                         const BodySolverOptions& options) {
  BodyBatch<Real> batch;
  for (const auto& environment : all) batch.add(environment);
  try {
    BodySolution<Real> solution = solve_bodies(batch, stepping, options);
    require(all_finite(std::span<const Real>(solution.impulse)), "impulses are finite");
    require(all_finite(std::span<const Real>(solution.twist)), "twists are finite");
    require(all_finite(std::span<const Real>(solution.w)), "motions of bodies are finite");
    for (const EnvStatus& status : solution.status) require_sound_record(status);
    return solution;
  } catch (const Error& error) {
    require(is_refusal(error.code()), error.what());
    return std::nullopt;
  }
}

template <class Real>
void require_part(const std::vector<Real>& all, const std::vector<Real>& alone, std::size_t begin,
                  const char* promise) {
  require(same_bits(std::span<const Real>(all).subspan(begin, alone.size()), std::span<const Real>(alone)), promise);
}

template <class Real>
void check(Bytes& bytes) {
  const BodySolverOptions options = body_options(bytes);
  const TimeStepping stepping = time_stepping(bytes);
  std::vector<BodyEnvironment<Real>> all(static_cast<std::size_t>(1 + bytes.below(3)));
  const auto spoiled = static_cast<std::size_t>(bytes.below(3));
  for (std::size_t env = 0; env < all.size(); ++env) {
    all[env] = sound_environment<Real>(bytes);
    if (env == spoiled) spoil(all[env], bytes);
  }
  const auto together = solved(all, stepping, options);
  std::size_t contact = 0, body = 0;
  for (std::size_t env = 0; env < all.size() && all.size() > 1; ++env) {
    const auto alone = solved(std::vector<BodyEnvironment<Real>>{all[env]}, stepping, options);
    require(together.has_value() == alone.has_value(), "numbers of one environment refuse no other");
    if (together && alone) {
      require_part(together->impulse, alone->impulse, contact, "impulses do not depend on neighbours");
      require_part(together->w, alone->w, contact, "motions of contacts do not depend on neighbours");
      require_part(together->twist, alone->twist, body, "twists do not depend on neighbours");
      require(same_bits(std::span<const EnvStatus>(together->status).subspan(env, 1),
                        std::span<const EnvStatus>(alone->status)),
              "a status does not depend on neighbours");
    }
    contact += 3 * all[env].contacts.size();
    body += 6 * all[env].bodies.size();
  }
}

}  // namespace

void check_bodies(Bytes& bytes) {
  if (bytes.once_in(2)) {
    check<double>(bytes);
  } else {
    check<float>(bytes);
  }
}

}  // namespace stiction::fuzz
