#include "tests/fuzz/c_session.hpp"

#include <algorithm>

namespace stiction::fuzz {
namespace {

constexpr std::size_t kAllRows = std::size_t{kEnvs} * kRows;
constexpr std::size_t kAllDofs = std::size_t{kEnvs} * kDofs;
constexpr std::size_t kAllContacts = std::size_t{kEnvs} * kContacts;
constexpr std::size_t kAllBodies = std::size_t{kEnvs} * kBodies;

/// Destroys, and requires that a handle is alive once.
template <class Handle, class Destroy>
void destroy_one(Held<Handle>& held, Destroy destroy) {
  const bool done = succeeded(destroy(held.handle));
  require(done == (held.alive || held.handle == nullptr), "a handle is destroyed once");
  held.alive = false;
}

/// Replaces the held object by that of make(&handle).
template <class Handle, class Destroy, class Make>
void replace(Held<Handle>& held, Destroy destroy, Make make) {
  if (held.alive) destroy_one(held, destroy);
  Handle* made = nullptr;
  if (succeeded(make(&made))) {
    held = {made, true};
  } else {
    require(made == nullptr, "a failed call makes no handle");
  }
}

template <class Solution, class Real>
Solution solution_of(Answers<Real>& answers, stiction_code (*init)(Solution*, std::size_t)) {
  Solution solution;
  require(succeeded(init(&solution, sizeof solution)), "a solution is set up");
  solution.status = answers.status.data();
  return solution;
}

template <class Real>
stiction_solution contact_solution(Answers<Real>& answers) {
  auto solution = solution_of<stiction_solution>(answers, stiction_solution_init);
  solution.lambda = answers.numbers[0].data();
  solution.w = answers.numbers[1].data();
  return solution;
}

template <class Real>
stiction_jacobian_solution jacobian_solution(Answers<Real>& answers) {
  auto solution = solution_of<stiction_jacobian_solution>(answers, stiction_jacobian_solution_init);
  solution.lambda = answers.numbers[0].data();
  solution.w = answers.numbers[1].data();
  solution.velocity = answers.numbers[2].data();
  return solution;
}

template <class Real>
stiction_body_solution body_solution(Answers<Real>& answers) {
  auto solution = solution_of<stiction_body_solution>(answers, stiction_body_solution_init);
  solution.impulse = answers.numbers[0].data();
  solution.w = answers.numbers[1].data();
  solution.twist = answers.numbers[2].data();
  return solution;
}

/// One pointer or size of a solution made wrong, now and then.
template <class Solution>
void spoil_solution(Solution& solution, Bytes& bytes) {
  if (!bytes.once_in(16)) return;
  if (bytes.once_in(3)) solution.status = nullptr;
  if (bytes.once_in(3)) solution.w = nullptr;
  if (bytes.once_in(3)) solution.w = solution.status;
  if (bytes.once_in(3)) solution.size = wild_size(bytes, solution.size);
}

template <class Real>
void require_outcome(bool done, bool alive, const Answers<Real>& answers) {
  require(alive || !done, "a handle that is not alive solves nothing");
  require(done || answers.untouched(), "a call that failed has written nothing");
}

/// Null, zeros, or numbers some of which are wild.
template <class Real>
std::vector<Real> warm_start(Bytes& bytes, std::size_t count) {
  std::vector<Real> start(count, Real(0.5));
  if (bytes.once_in(2)) start[bytes.byte() % count] = wild<Real>(bytes);
  return start;
}

}  // namespace

template <class Real>
Session<Real>::~Session() {
  stiction_stepping_solver_destroy(stepping_[2].alive ? stepping_[2].handle : nullptr);
  stiction_solver_destroy(solver_.alive ? solver_.handle : nullptr);
  stiction_stepping_solver_destroy(stepping_[0].alive ? stepping_[0].handle : nullptr);
  stiction_body_solver_destroy(body_solver_.alive ? body_solver_.handle : nullptr);
  stiction_jacobian_solver_destroy(jacobian_solver_.alive ? jacobian_solver_.handle : nullptr);
  stiction_stepping_solver_destroy(stepping_[1].alive ? stepping_[1].handle : nullptr);
}

template <class Real>
void Session<Real>::call(Bytes& bytes) {
  switch (bytes.below(12)) {
    case 0:
      return create(bytes);
    case 1:
      return bytes.once_in(2) ? destroy(bytes) : restore();
    case 2:
    case 3:
      return edit(bytes);
    case 4:
    case 5:
    case 6:
      return solve_contacts(bytes);
    case 7:
      return judge_contacts(bytes);
    case 8:
      return solve_jacobians(bytes);
    case 9:
      return solve_bodies(bytes);
    case 10:
      return step(bytes);
    default:
      return reset_environments(bytes);
  }
}

template <class Real>
void Session<Real>::create(Bytes& bytes) {
  const stiction_solver_options options = c_solver_options(bytes);
  const stiction_body_options body_options = c_body_options(bytes);
  const stiction_time_stepping stepping = c_time_stepping(bytes);
  const stiction_warm_start_options warm_start = c_warm_start_options(bytes);
  stiction_capacity capacity;
  stiction_capacity_init(&capacity, sizeof capacity);
  stiction_jacobian_capacity jacobian_capacity;
  stiction_jacobian_capacity_init(&jacobian_capacity, sizeof jacobian_capacity);
  const auto contacts = contact_form<Real>();
  const auto jacobians = jacobian_form<Real>();
  jacobian_capacity.factor_use = bytes.below(3);
  require(succeeded(stiction_capacity_of(&contacts.view, &capacity)), "a sound batch has a capacity");
  require(succeeded(stiction_jacobian_capacity_of(&jacobians.view, &jacobian_capacity)),
          "a sound Jacobian batch has a capacity");
  if (bytes.once_in(8)) spoil_capacity(capacity, bytes);
  if (bytes.once_in(8)) spoil_capacity(jacobian_capacity, bytes);
  constexpr const char* kDevices[] = {"cpu", "cpu", "cpu", "auto", "", "cuda:-1", "tpu", nullptr};
  const char* device = bytes.once_in(8) ? bytes.one_of(kDevices) : "cpu";
  const stiction_capacity* room = bytes.once_in(2) ? &capacity : nullptr;
  switch (bytes.below(6)) {
    case 0:
      untouched_.reset();
      return replace(solver_, stiction_solver_destroy,
                     [&](auto** made) { return stiction_solver_create(device, &options, room, made); });
    case 1:
      return replace(jacobian_solver_, stiction_jacobian_solver_destroy, [&](auto** made) {
        return stiction_jacobian_solver_create(device, &options, &jacobian_capacity, made);
      });
    case 2:
      return replace(body_solver_, stiction_body_solver_destroy,
                     [&](auto** made) { return stiction_body_solver_create(device, &stepping, &body_options, made); });
    case 3:
      return replace(stepping_[0], stiction_stepping_solver_destroy, [&](auto** made) {
        return stiction_stepping_solver_create(device, &options, &capacity, &warm_start, made);
      });
    case 4:
      return replace(stepping_[1], stiction_stepping_solver_destroy, [&](auto** made) {
        return stiction_stepping_solver_create_jacobian(device, &options, &jacobian_capacity, &warm_start, made);
      });
    default:
      return replace(stepping_[2], stiction_stepping_solver_destroy, [&](auto** made) {
        return stiction_stepping_solver_create_bodies(device, &stepping, &body_options, &capacity, &warm_start, made);
      });
  }
}

template <class Real>
void Session<Real>::destroy(Bytes& bytes) {
  switch (bytes.below(5)) {
    case 0:
      return destroy_one(solver_, stiction_solver_destroy);
    case 1:
      return destroy_one(jacobian_solver_, stiction_jacobian_solver_destroy);
    case 2:
      return destroy_one(body_solver_, stiction_body_solver_destroy);
    case 3:
      return destroy_one(stepping_[bytes.below(3)], stiction_stepping_solver_destroy);
    default: {  // a handle of another kind
      auto* other = reinterpret_cast<stiction_body_solver*>(solver_.handle);
      require(succeeded(stiction_body_solver_destroy(other)) == (other == nullptr),
              "handles of other kinds are refused");
    }
  }
}

template <class Real>
void Session<Real>::restore() {
  contacts_ = contact_form<Real>();
  jacobians_ = jacobian_form<Real>();
  bodies_ = body_form<Real>();
  for (bool& reached : reached_) reached = false;
}

template <class Real>
void Session<Real>::edit(Bytes& bytes) {
  const int which = bytes.below(4);
  if (which == 2) {
    jacobians_.edit(bytes, kEnvs);
  } else if (which == 3) {
    bodies_.edit(bytes, kEnvs);
  } else {
    const int env = contacts_.edit(bytes, kEnvs);
    for (int i = 0; i < kEnvs; ++i) reached_[i] = reached_[i] || env < 0 || env == i;
  }
}

/// Environments that no edit reached keep the bits that they have in the sound batch.
template <class Real>
void Session<Real>::require_neighbours(const Answers<Real>& answers) {
  if (!untouched_) {
    const auto sound = contact_form<Real>();
    untouched_.emplace(std::vector<std::size_t>{kAllRows, kAllRows}, kEnvs);
    const stiction_solution solution = contact_solution(*untouched_);
    require(succeeded(stiction_solver_solve(solver_.handle, &sound.view, &solution, nullptr, nullptr)),
            "a sound batch is solved by a solver that solved another");
  }
  for (std::size_t env = 0; env < kEnvs; ++env) {
    if (!reached_[env]) require(answers.same_in(*untouched_, env), "an edit changes no bit of another environment");
  }
}

template <class Real>
void Session<Real>::solve_contacts(Bytes& bytes) {
  if (bytes.once_in(4)) {
    const bool planned = succeeded(stiction_solver_plan(solver_.handle, &contacts_.view, nullptr));
    require(solver_.alive || !planned, "a handle that is not alive plans nothing");
    return;
  }
  Answers<Real> answers({kAllRows, kAllRows}, kEnvs);
  stiction_solution solution = contact_solution(answers);
  spoil_solution(solution, bytes);
  const std::vector<Real> start = warm_start<Real>(bytes, kAllRows);
  const Real* warm = bytes.once_in(4) ? start.data() : nullptr;
  const bool planned = bytes.once_in(2);
  const bool done =
      succeeded(planned ? stiction_solver_solve_planned(solver_.handle, &contacts_.view, &solution, warm, nullptr)
                        : stiction_solver_solve(solver_.handle, &contacts_.view, &solution, warm, nullptr));
  require_outcome(done, solver_.alive, answers);
  if (!done || contacts_.view.env_count != kEnvs || contacts_.view.row_count != kEnvs * kRows) return;
  if (!contacts_.is_present(offsetof(stiction_batch_view, env_row_counts))) {
    require(answers.finite(0), "reactions are finite");
    require(solution.w == nullptr || answers.finite(1), "motions are finite");
  }
  if (warm == nullptr && !planned && solution.w != nullptr) require_neighbours(answers);
}

template <class Real>
void Session<Real>::judge_contacts(Bytes& bytes) {
  const std::vector<Real> lambda = warm_start<Real>(bytes, kAllRows);
  switch (bytes.below(3)) {
    case 0: {
      stiction_residual residual[kEnvs];
      succeeded(stiction_verify(&contacts_.view, bytes.once_in(8) ? nullptr : lambda.data(), residual));
      return;
    }
    case 1:
      succeeded(stiction_validate(&contacts_.view, bytes.byte()));
      return;
    default: {
      stiction_capacity capacity;
      stiction_capacity_init(&capacity, sizeof capacity);
      capacity.size = wild_size(bytes, capacity.size);
      succeeded(stiction_capacity_of(&contacts_.view, &capacity));
    }
  }
}

template <class Real>
void Session<Real>::solve_jacobians(Bytes& bytes) {
  Answers<Real> answers({kAllRows, kAllRows, kAllDofs}, kEnvs);
  stiction_jacobian_solution solution = jacobian_solution(answers);
  spoil_solution(solution, bytes);
  if (bytes.once_in(16)) solution.velocity = nullptr;
  const std::vector<Real> start = warm_start<Real>(bytes, kAllRows);
  const Real* const reactions = bytes.once_in(4) ? start.data() : nullptr;
  const std::vector<Real> motion = warm_start<Real>(bytes, kAllDofs);
  const Real* const velocities = bytes.once_in(4) ? motion.data() : nullptr;
  const bool done = succeeded(stiction_jacobian_solver_solve_from(jacobian_solver_.handle, &jacobians_.view, &solution,
                                                                  reactions, velocities, nullptr));
  require_outcome(done, jacobian_solver_.alive, answers);
  succeeded(stiction_jacobian_solver_synchronize(jacobian_solver_.handle, nullptr));
}

template <class Real>
void Session<Real>::solve_bodies(Bytes& bytes) {
  if (bytes.once_in(4)) {
    succeeded(stiction_body_solver_plan(body_solver_.handle, &bodies_.view, nullptr));
    return;
  }
  Answers<Real> answers({3 * kAllContacts, 3 * kAllContacts, 6 * kAllBodies}, kEnvs);
  stiction_body_solution solution = body_solution(answers);
  spoil_solution(solution, bytes);
  const std::vector<Real> start = warm_start<Real>(bytes, 3 * kAllContacts);
  const bool done = succeeded(stiction_body_solver_solve(body_solver_.handle, &bodies_.view, &solution,
                                                         bytes.once_in(4) ? start.data() : nullptr, nullptr));
  require_outcome(done, body_solver_.alive, answers);
}

template <class Real>
void Session<Real>::step(Bytes& bytes) {
  // Ids are unique within an environment, unless the bytes make them equal.
  std::vector<std::uint64_t> ids(kAllContacts);
  for (std::size_t i = 0; i < ids.size(); ++i) ids[i] = i;
  if (bytes.once_in(4)) ids[bytes.byte() % ids.size()] = bytes.byte();
  const std::uint64_t* id = bytes.once_in(16) ? nullptr : ids.data();
  const double dt = bytes.once_in(4) ? wild<double>(bytes) : 0.01;
  const int which = bytes.below(3);
  const auto& solver = stepping_[bytes.once_in(8) ? bytes.below(3) : which];
  Answers<Real> answers(which == 2 ? std::vector<std::size_t>{3 * kAllContacts, 3 * kAllContacts, 6 * kAllBodies}
                                   : std::vector<std::size_t>{kAllRows, kAllRows, kAllDofs},
                        kEnvs);
  bool done = false;
  if (which == 0) {
    const stiction_solution solution = contact_solution(answers);
    done = succeeded(stiction_stepping_solver_solve(solver.handle, &contacts_.view, id, dt, &solution, nullptr));
  } else if (which == 1) {
    const stiction_jacobian_solution solution = jacobian_solution(answers);
    done =
        succeeded(stiction_stepping_solver_solve_jacobian(solver.handle, &jacobians_.view, id, dt, &solution, nullptr));
  } else {
    const stiction_body_solution solution = body_solution(answers);
    done = succeeded(stiction_stepping_solver_solve_bodies(solver.handle, &bodies_.view, id, &solution, nullptr));
  }
  require_outcome(done, solver.alive, answers);
}

template <class Real>
void Session<Real>::reset_environments(Bytes& bytes) {
  stiction_stepping_solver* const solver = stepping_[bytes.below(3)].handle;
  const std::int64_t envs[] = {0, wild_integer<std::int64_t>(bytes, kEnvs)};
  const std::int64_t counts[] = {0, 1, 2, -1, std::numeric_limits<std::int64_t>::min()};
  switch (bytes.below(4)) {
    case 0:
      succeeded(
          stiction_stepping_solver_reset(solver, bytes.once_in(8) ? nullptr : envs, bytes.one_of(counts), nullptr));
      return;
    case 1: {
      // The mask has one entry for each environment of the capacity, which a spoiled one may set to 255 at most.
      const std::vector<std::uint8_t> mask(256, bytes.byte());
      succeeded(stiction_stepping_solver_reset_where(solver, mask.data(), nullptr));
      return;
    }
    case 2: {
      stiction_warm_start_record records[2];
      succeeded(stiction_stepping_solver_records(solver, records, bytes.one_of(counts), nullptr));
      return;
    }
    default:
      succeeded(stiction_stepping_solver_reset_all(solver, nullptr));
      succeeded(stiction_stepping_solver_synchronize(solver, nullptr));
  }
}

template class Session<float>;
template class Session<double>;

}  // namespace stiction::fuzz
