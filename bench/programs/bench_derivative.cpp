// Cost of a derivative in reverse and forward, relative to the solve that it differentiates. All alternate in one run;
// the shortest of all repeats counts.
//
//   bench_derivative [--folder DIR] [--files humanoid,...] [--scenes walker,...] [--form jacobian,contacts]
//                    [--envs 256] [--tolerance 1e-6] [--precision f32] [--repeats 7] [--threads 1] [--csv PATH]

#include <algorithm>
#include <cstdio>
#include <limits>

#include "bench/support/arguments.hpp"
#include "bench/support/jacobian_cases.hpp"
#include "bench/support/machine.hpp"
#include "bench/support/table_main.hpp"

namespace stiction::bench {

namespace {

/// The shortest times of a call [s], and how it went.
struct Measured {
  double solve = std::numeric_limits<double>::infinity();
  double reverse = solve, forward = solve;
  std::size_t solved = 0, refused = 0;
  double rows = 0.0, unknowns = 0.0;  ///< mean of an environment
};

template <class F>
void time(double& shortest, const F& call) {
  const double start = cpu_seconds();
  call();
  shortest = std::min(shortest, cpu_seconds() - start);
}

void count(Measured& found, Offset rows, const std::vector<EnvStatus>& status,
           const std::vector<GradientStatus>& gradients) {
  for (const EnvStatus& one : status) found.solved += one.code == EnvCode::solved ? 1 : 0;
  double unknowns = 0.0;
  for (const GradientStatus& one : gradients) {
    found.refused += (one.flags & kGradientRefused) != 0 ? 1 : 0;
    unknowns += one.unknowns;
  }
  const auto envs = static_cast<double>(status.size());
  found.rows = static_cast<double>(rows) / envs;
  found.unknowns = unknowns / envs;
}

/// A loss of velocities, its derivatives by J, M, v_free, target, R and mu, and changes along these. Zeros of M stay,
/// so that no bodies become coupled.
template <class Real>
Measured measure_jacobians(const JacobianBatch<Real>& batch, const SolverOptions& options, int repeats) {
  const auto view = batch.view();
  const auto room = [](Offset size) { return std::vector<Real>(static_cast<std::size_t>(size)); };
  auto lambda = room(view.row_count), velocity = room(view.dof_count), J = room(view.entry_count),
       M = room(view.mass_count), v_free = room(view.dof_count), target = room(view.row_count),
       R = room(view.row_count), mu = room(view.row_count), change = velocity;
  const std::vector<Real> bar(velocity.size(), Real(1));
  std::vector<EnvStatus> status(static_cast<std::size_t>(view.env_count));
  std::vector<GradientStatus> gradients(status.size());
  JacobianSolver<Real> solver(Device::cpu(), options, JacobianCapacity::of(view));
  DerivativeOptions own;
  own.threads = options.threads;
  own.max_unknowns = 4096;
  const Derivative derivative(Device::cpu(), own);
  Measured found;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    time(found.solve,
         [&] { solver.solve(view, {lambda.data(), nullptr, velocity.data(), status.data()}, JacobianStart<Real>{}); });
    const ReactionView<Real> at{lambda.data(), status.data()};
    time(found.reverse, [&] {
      derivative.vjp(view, at, JacobianSolutionCotangentView<Real>{nullptr, nullptr, bar.data()},
                     JacobianBatchCotangentView<Real>{J.data(), M.data(), v_free.data(), target.data(), R.data(),
                                                      mu.data(), nullptr, nullptr},
                     gradients.data());
    });
    for (std::size_t i = 0; i < M.size(); ++i)
      if (view.M[i] == Real(0)) M[i] = Real(0);
    time(found.forward, [&] {
      derivative.jvp(view, at,
                     JacobianBatchTangentView<Real>{J.data(), M.data(), v_free.data(), target.data(), R.data(),
                                                    mu.data(), nullptr, nullptr},
                     JacobianSolutionTangentView<Real>{nullptr, nullptr, change.data()}, gradients.data());
    });
  }
  count(found, view.row_count, status, gradients);
  return found;
}

/// A loss of reactions, its derivatives by A, b, R and mu, and changes along these.
template <class Real>
Measured measure_contacts(const ContactBatch<Real>& batch, const SolverOptions& options, int repeats) {
  const auto view = batch.view();
  const auto room = [](Offset size) { return std::vector<Real>(static_cast<std::size_t>(size)); };
  auto lambda = room(view.row_count), w = lambda, A = room(view.nonzero_count), b = lambda, R = lambda, mu = lambda,
       change = lambda;
  const std::vector<Real> bar(lambda.size(), Real(1));
  std::vector<EnvStatus> status(static_cast<std::size_t>(view.env_count));
  std::vector<GradientStatus> gradients(status.size());
  const Solver solver(Device::cpu(), options);
  const Plan plan = solver.plan(view);
  DerivativeOptions own;
  own.threads = options.threads;
  own.max_unknowns = 4096;
  const Derivative derivative(Device::cpu(), own);
  Measured found;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    time(found.solve, [&] { solver.solve(plan, view, {lambda.data(), w.data(), status.data()}); });
    const ReactionView<Real> at{lambda.data(), status.data()};
    time(found.reverse, [&] {
      derivative.vjp(view, at, SolutionCotangentView<Real>{bar.data(), nullptr},
                     BatchCotangentView<Real>{A.data(), nullptr, b.data(), R.data(), mu.data(), nullptr, nullptr},
                     gradients.data());
    });
    time(found.forward, [&] {
      derivative.jvp(view, at,
                     BatchTangentView<Real>{A.data(), nullptr, b.data(), R.data(), mu.data(), nullptr, nullptr},
                     SolutionTangentView<Real>{change.data(), nullptr}, gradients.data());
    });
  }
  count(found, view.row_count, status, gradients);
  return found;
}

template <class Real>
Measured measure(const JacobianCase& own, const std::string& form, std::size_t envs, const SolverOptions& options,
                 int repeats) {
  const auto batch = own.batch<Real>(envs);
  if (form == "jacobian") return measure_jacobians<Real>(batch, options, repeats);
  return measure_contacts<Real>(assemble(batch.view(), FactorUse::never), options, repeats);
}

}  // namespace

int run(int argc, char** argv) {
  const Arguments arguments(argc, argv,
                            {{"--folder", "examples/data"},
                             {"--files", "humanoid,hand_cube,quadruped_rough"},
                             {"--scenes", "walker,grasp,stack"},
                             {"--form", "jacobian,contacts"},
                             {"--envs", "256"},
                             {"--tolerance", "1e-6"},
                             {"--precision", "f32"},
                             {"--repeats", "7"},
                             {"--threads", "1"}});
  SolverOptions options;
  options.solver = SolverKind::automatic;
  options.tolerance = arguments.number("--tolerance");
  options.max_iterations = 20000;
  options.threads = arguments.count("--threads");
  const auto envs = static_cast<std::size_t>(arguments.count("--envs"));
  const bool single = arguments.text("--precision") == "f32";
  std::vector<JacobianCase> cases;
  for (const std::string& file : arguments.texts("--files"))
    cases.push_back(recorded_case(arguments.text("--folder") + "/" + file + ".h5", envs));
  for (const std::string& scene : arguments.texts("--scenes"))
    cases.push_back(scene_case(scene, std::min<std::size_t>(envs, 64)));
  const auto csv = arguments.csv(
      "case,form,rows,unknowns,solved,refused,solve_us,reverse_us,forward_us,reverse_ratio,forward_ratio");
  std::printf("%-16s %-9s %6s %8s %7s %7s %10s %10s %10s %6s %6s\n", "case", "form", "rows", "unknowns", "solved",
              "refused", "solve us", "reverse us", "forward us", "ratio", "ratio");
  for (const JacobianCase& own : cases)
    for (const std::string& form : arguments.texts("--form")) {
      const Measured found = single ? measure<float>(own, form, envs, options, arguments.count("--repeats"))
                                    : measure<double>(own, form, envs, options, arguments.count("--repeats"));
      const double to_us = 1e6 / static_cast<double>(envs), reverse = found.reverse / found.solve,
                   forward = found.forward / found.solve;
      std::printf("%-16s %-9s %6.1f %8.1f %7zu %7zu %10.2f %10.2f %10.2f %6.2f %6.2f\n", own.name.c_str(), form.c_str(),
                  found.rows, found.unknowns, found.solved, found.refused, found.solve * to_us, found.reverse * to_us,
                  found.forward * to_us, reverse, forward);
      std::fflush(stdout);
      if (csv)
        csv->row({own.name, form, number(found.rows, 4), number(found.unknowns, 4), std::to_string(found.solved),
                  std::to_string(found.refused), number(found.solve * to_us, 4), number(found.reverse * to_us, 4),
                  number(found.forward * to_us, 4), number(reverse, 3), number(forward, 3)});
    }
  return EXIT_SUCCESS;
}

}  // namespace stiction::bench
