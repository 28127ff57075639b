#include "stiction/jacobian_solver.hpp"
#include "tests/support/golden/bodies.hpp"
#include "tests/support/golden/forms.hpp"
#include "tests/support/systems/derivative_cases.hpp"
#include "tools/gpu_first/arrays.hpp"
#include "tools/gpu_first/check.hpp"

/// Checks beyond plain contact batches: bodies, worlds, Jacobians, derivatives.
namespace stiction::gpu_first {

namespace {

/// Many environments of random bodies, of all classes.
template <class Real>
BodyBatch<Real> many_bodies(bool full) {
  BodyBatch<Real> batch;
  const std::uint64_t count = full ? 4000 : 30;
  for (std::uint64_t seed = 0; seed < count; ++seed) {
    const auto contacts = static_cast<Index>(seed * 8 % 21);
    batch.add(test::as<Real>(test::random_bodies(seed, 2 + static_cast<Index>(seed % 5), contacts)));
    if (seed % 10 == 7) batch.add(test::as<Real>(test::random_bodies(seed, 9, 45)));
  }
  batch.add(test::as<Real>(scenes::make_body_pile(4, full ? 550 : 120)));
  return batch;
}

template <class Real>
Hashes solved_bodies(const BodyBatch<Real>& batch, const BodySolverOptions& options, Device device) {
  const BodySolution<Real> solution = solve_bodies(batch, TimeStepping{}, options, device);
  test::Digest status;
  status.add(std::span<const EnvStatus>(solution.status));
  return {hash_of(solution.impulse), hash_of(solution.twist), hash_of(solution.w), status.value()};
}

template <class Real>
void compare_bodies(Report& report, const char* precision) {
  const BodyBatch<Real> batch = many_bodies<Real>(report.setting().full);
  for (const BodyMethod method : {BodyMethod::impulses, BodyMethod::newton})
    for (const Law law : test::kBothLaws) {
      BodySolverOptions options;
      options.method = method;
      options.law = law;
      options.iterations = method == BodyMethod::newton ? 3 : 17;
      options.invalid = InvalidPolicy::isolate;
      report.compare(
          std::string(method == BodyMethod::newton ? "newton " : "impulses ") + precision + " " + to_string(law),
          [&] { return solved_bodies(batch, options, Device::cpu()); },
          [&] { return solved_bodies(batch, options, report.target()->device()); });
    }
}

void bodies(Report& report) {
  compare_bodies<float>(report, "f32");
  compare_bodies<double>(report, "f64");
}

void worlds(Report& report) {
  const bool full = report.setting().full;
  const auto compare = [&](const std::string& name, const std::string& scene, Offset envs, int steps, int size) {
    const auto walked = [&](Device device) {
      World<float> world = test::started<float>(scene, envs, {}, device, 3, size);
      test::run(world, steps);
      return Hashes{test::world_hash(world)};
    };
    report.compare(name, [&] { return walked(Device::cpu()); }, [&] { return walked(report.target()->device()); });
  };
  for (const std::string& scene : scenes::world_names()) compare(scene, scene, full ? 256 : 2, full ? 60 : 12, 0);
  // The pile has so many shapes that a tree finds their pairs.
  compare("large pile", "pile", full ? 8 : 1, full ? 60 : 12, full ? 1000 : 150);
}

/// Environments whose A is written on the device, and chains that Newton's method in velocities answers.
template <class Real>
JacobianBatch<Real> jacobians(const std::string& kind, bool full) {
  JacobianBatch<Real> batch(Law::convex, MassForm::matrix, kind == "blocks" ? 6 : 0);
  for (std::uint64_t seed = 1; seed <= (full ? 200U : 4U); ++seed) {
    if (kind == "chains") {
      batch.add(test::cast<Real>(test::random_chain({seed, static_cast<Index>(9 + seed % 20)})));
    } else if (kind == "bodies") {
      batch.add(test::cast<Real>(test::bodies_in_contact({seed, 9 + 2 * (seed % 4), 3, 2 * (seed % 5)})));
    } else {
      const Index block = kind == "blocks" ? 6 : 0;
      batch.add(test::cast<Real>(
          test::random_jacobian({seed, static_cast<int>(seed % 26), 2 + static_cast<int>(seed % 8), 12, block})));
    }
  }
  return batch;
}

/// Returns the answer of a JacobianSolver whose batch is where its device reads it.
template <class Real>
Hashes solved_jacobians(const JacobianBatchView<Real>& host, const SolverOptions& options, Target* target) {
  const JacobianCapacity capacity = JacobianCapacity::of(host);
  if (target == nullptr) {
    const JacobianSolution<Real> answer = solve(host, options);
    test::Digest status;
    status.add(std::span<const EnvStatus>(answer.contact.status));
    return {hash_of(answer.contact.lambda), hash_of(answer.contact.w), hash_of(answer.velocity), status.value()};
  }
  Arrays arrays(target->api());
  JacobianSolver<Real> solver(target->device(), options, capacity);
  const JacobianBatchView<Real> view = on_device(arrays, host);
  const JacobianSolutionView<Real> there{arrays.room<Real>(host.row_count), arrays.room<Real>(host.row_count),
                                         arrays.room<Real>(host.dof_count), arrays.room<EnvStatus>(host.env_count)};
  solver.solve(view, there, static_cast<const Real*>(nullptr), StreamRef(arrays.stream()));
  arrays.synchronize();
  const std::vector<EnvStatus> records = arrays.fetch(there.status, host.env_count);
  test::Digest status;
  status.add(std::span<const EnvStatus>(records));
  return {hash_of(arrays.fetch(there.lambda, host.row_count)), hash_of(arrays.fetch(there.w, host.row_count)),
          hash_of(arrays.fetch(there.velocity, host.dof_count)), status.value()};
}

template <class Real>
void compare_jacobians(Report& report, const std::string& kind, SolverKind solver, const char* precision) {
  const JacobianBatch<Real> batch = jacobians<Real>(kind, report.setting().full);
  SolverOptions options = test::options(solver, sizeof(Real) == sizeof(float) ? 1e-4 : 1e-8, 60);
  options.invalid = InvalidPolicy::isolate;
  options.threads = 0;
  report.compare(
      kind + " " + to_string(solver) + " " + precision,
      [&] { return solved_jacobians(batch.view(), options, nullptr); },
      [&] { return solved_jacobians(batch.view(), options, report.target()); });
}

void jacobian(Report& report) {
  for (const char* const kind : {"dense", "blocks"}) {
    compare_jacobians<float>(report, kind, SolverKind::npgs, "f32");
    compare_jacobians<double>(report, kind, SolverKind::npgs, "f64");
  }
}

void velocity_newton(Report& report) {
  for (const char* const kind : {"chains", "bodies"}) {
    compare_jacobians<float>(report, kind, SolverKind::automatic, "f32");
    compare_jacobians<double>(report, kind, SolverKind::automatic, "f64");
  }
}

template <class Real>
ContactBatch<Real> derivative_batch(bool full) {
  ContactBatch<double> batch(Law::convex);
  for (std::uint64_t seed = 1; seed <= (full ? 400U : 8U); ++seed) {
    test::Recipe recipe;
    recipe.seed = seed;
    recipe.contacts = static_cast<int>(seed % 5);
    recipe.others = static_cast<int>(seed % 4);
    batch.add(test::random_contacts(recipe));
  }
  return convert<Real>(batch);
}

/// Cotangents and tangents of a batch, on the CPU or where the device reads them.
template <class Real>
Hashes derivatives(const ContactBatch<Real>& batch, const std::vector<Real>& lambda, const DerivativeOptions& options,
                   Target* target) {
  const auto host = batch.view();
  const auto bar = test::random_numbers<Real>(lambda.size(), 1), w_bar = test::random_numbers<Real>(lambda.size(), 2);
  const auto nudge = test::random_numbers<Real>(batch.arrays().A.size(), 3);
  if (target == nullptr) {
    const auto back = test::vjp(host, lambda, bar, w_bar, options);
    const auto forth = test::jvp(host, lambda, BatchTangentView<Real>{nudge.data(), nullptr, bar.data()}, options);
    return {hash_of(back.A),  hash_of(back.b),       hash_of(back.R),
            hash_of(back.mu), hash_of(forth.lambda), hash_of(forth.w)};
  }
  Arrays arrays(target->api());
  const Derivative derivative(target->device(), options, Capacity::of(host));
  const auto view = on_device(arrays, host);
  const ReactionView<Real> at{arrays.put(lambda), nullptr};
  const StreamRef stream{arrays.stream()};
  const Offset rows = host.row_count, entries = host.nonzero_count;
  const BatchCotangentView<Real> to{arrays.room<Real>(entries), nullptr,
                                    arrays.room<Real>(rows),    arrays.room<Real>(rows),
                                    arrays.room<Real>(rows),    arrays.room<Real>(rows),
                                    arrays.room<Real>(rows)};
  GradientStatus* const status = arrays.room<GradientStatus>(host.env_count);
  derivative.vjp(view, at, SolutionCotangentView<Real>{arrays.put(bar), arrays.put(w_bar)}, to, status, 1, stream);
  const SolutionTangentView<Real> changes{arrays.room<Real>(rows), arrays.room<Real>(rows)};
  derivative.jvp(view, at, BatchTangentView<Real>{arrays.put(nudge), nullptr, arrays.put(bar)}, changes, status, 1,
                 stream);
  arrays.synchronize();
  return {hash_of(arrays.fetch(to.A, entries)),        hash_of(arrays.fetch(to.b, rows)),
          hash_of(arrays.fetch(to.R, rows)),           hash_of(arrays.fetch(to.mu, rows)),
          hash_of(arrays.fetch(changes.lambda, rows)), hash_of(arrays.fetch(changes.w, rows))};
}

/// Ten sweeps in reverse: their answer, and cotangents of the batch and of where they began.
template <class Real>
Hashes sweeps(const ContactBatch<Real>& batch, Target* target) {
  constexpr Index kSweeps = 10;
  const auto host = batch.view();
  const auto rows = static_cast<std::size_t>(host.row_count), entries = static_cast<std::size_t>(host.nonzero_count);
  const auto start = test::random_numbers<Real>(rows, 1), bar = test::random_numbers<Real>(rows, 2);
  if (target == nullptr) {
    std::vector<Real> lambda(rows), by_start(rows), A(entries), b(rows), mu(rows);
    std::vector<GradientStatus> status(static_cast<std::size_t>(host.env_count));
    Derivative().unrolled_vjp(host, SweepsView<Real>{start.data(), kSweeps, 1.0, lambda.data(), by_start.data()},
                              SolutionCotangentView<Real>{bar.data(), nullptr},
                              BatchCotangentView<Real>{A.data(), nullptr, b.data(), nullptr, mu.data()}, status.data());
    return {hash_of(lambda), hash_of(by_start), hash_of(A), hash_of(b), hash_of(mu)};
  }
  Arrays arrays(target->api());
  const Derivative derivative(target->device(), {}, Capacity::of(host));
  const auto room = [&] { return arrays.room<Real>(host.row_count); };
  const SweepsView<Real> of{arrays.put(start), kSweeps, 1.0, room(), room()};
  const BatchCotangentView<Real> to{arrays.room<Real>(host.nonzero_count), nullptr, room(), nullptr, room()};
  derivative.unrolled_vjp(on_device(arrays, host), of, SolutionCotangentView<Real>{arrays.put(bar), nullptr}, to,
                          arrays.room<GradientStatus>(host.env_count), 1, StreamRef{arrays.stream()});
  arrays.synchronize();
  const auto fetch = [&](const Real* numbers) { return hash_of(arrays.fetch(numbers, host.row_count)); };
  return {fetch(of.lambda), fetch(of.by_warm_start), hash_of(arrays.fetch(to.A, host.nonzero_count)), fetch(to.b),
          fetch(to.mu)};
}

template <class Real>
void compare_derivatives(Report& report, const std::string& precision) {
  const ContactBatch<Real> batch = derivative_batch<Real>(report.setting().full);
  SolverOptions options = test::options(SolverKind::npgs, 1e-5, 1000);
  options.threads = 0;
  const std::vector<Real> lambda = solve(batch, options).lambda;
  for (const double kappa : {0.0, 1e-2}) {
    DerivativeOptions of;
    of.kappa = kappa;
    report.compare(
        kappa > 0.0 ? precision + " relaxed" : precision, [&] { return derivatives(batch, lambda, of, nullptr); },
        [&] { return derivatives(batch, lambda, of, report.target()); });
  }
  report.compare(
      precision + " sweeps", [&] { return sweeps(batch, nullptr); }, [&] { return sweeps(batch, report.target()); });
}

void derivative(Report& report) {
  compare_derivatives<float>(report, "f32");
  compare_derivatives<double>(report, "f64");
}

}  // namespace

void add_forms(Checks& checks) {
  checks.push_back({"form/bodies", 30, bodies});
  checks.push_back({"form/worlds", 40, worlds});
  checks.push_back({"form/jacobian", 30, jacobian});
  checks.push_back({"form/velocity_newton", 30, velocity_newton});
  checks.push_back({"form/derivative", 30, derivative});
}

}  // namespace stiction::gpu_first
