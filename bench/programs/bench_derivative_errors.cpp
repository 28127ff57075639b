// How far derivatives by J, M, v_free, target, R and mu are from central differences of the solve, in double, solved to
// 1e-12. All environments of a recording are moved at once, each along a direction of its own. One counts where no
// contact is in another mode at one of the two steps.
//
//   bench_derivative_errors [--folder DIR] [--files humanoid,...] [--envs 20] [--steps 1e-4,1e-5,1e-6] [--csv PATH]

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "bench/support/arguments.hpp"
#include "bench/support/jacobian_cases.hpp"
#include "bench/support/table_main.hpp"
#include "scenes/rng.hpp"

namespace stiction::bench {

namespace {

using Env = JacobianEnvironment<double>;
using Numbers = std::vector<double>;

/// What is differentiated by.
struct Parameter {
  const char* name;
  Numbers Env::* numbers;
  Numbers gradient;  ///< of all environments
};

/// Where an environment's numbers begin in the gradient of each parameter.
struct Place {
  Offset J, M, dof, row;
};

double largest(const Numbers& numbers) {
  double size = 0.0;
  for (const double number : numbers) size = std::max(size, std::abs(number));
  return size;
}

/// A change of a parameter, in the units of its numbers: of M symmetric, of what is zero in J zero.
Numbers direction_of(const Env& env, const Parameter& parameter, Index mass_block, scenes::Rng& rng) {
  const Numbers& numbers = env.*parameter.numbers;
  const std::string name = parameter.name;
  Numbers direction(numbers.size());
  const double scale = largest(numbers) > 0.0 ? largest(numbers) : 1.0;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const bool is_vector = name == "v_free" || name == "target";
    direction[i] = rng.symmetric(1.0) * (is_vector ? scale : std::abs(numbers[i]));
  }
  if (name != "M") return direction;
  const std::size_t block = mass_block == 0 ? env.v_free.size() : static_cast<std::size_t>(mass_block);
  for (std::size_t first = 0; first < direction.size(); first += block * block)
    for (std::size_t i = 0; i < block; ++i)
      for (std::size_t j = i + 1; j < block; ++j) direction[first + i * block + j] = direction[first + j * block + i];
  return direction;
}

/// All environments of a case, some numbers of each moved along `directions` by `step`.
JacobianCase moved(const JacobianCase& from, Numbers Env::* numbers, const std::vector<Numbers>& directions,
                   double step) {
  JacobianCase to = from;
  for (std::size_t e = 0; e < to.envs.size(); ++e)
    for (std::size_t i = 0; i < directions[e].size(); ++i) (to.envs[e].*numbers)[i] += step * directions[e][i];
  return to;
}

SolverOptions exact() {
  SolverOptions options;
  options.solver = SolverKind::newton;
  options.tolerance = 1e-12;
  options.max_iterations = 200;
  return options;
}

/// Losses of each environment's reactions and velocities, and what their contacts do.
struct Solved {
  Numbers loss;
  std::vector<GradientStatus> modes;
  std::vector<EnvStatus> status;
};

Solved solve_case(const JacobianCase& own, const Numbers& lambda_bar, const Numbers& v_bar,
                  std::vector<Parameter>* gradients) {
  const auto batch = own.batch<double>(own.envs.size());
  const auto view = batch.view();
  const auto solution = solve(batch, exact());
  Solved found{Numbers(own.envs.size()), std::vector<GradientStatus>(own.envs.size()), solution.contact.status};
  for (std::size_t e = 0; e < own.envs.size(); ++e) {
    const auto env = static_cast<Offset>(e);
    for (Offset i = view.env_row_offsets[env]; i < view.env_row_offsets[env + 1]; ++i)
      found.loss[e] += solution.contact.lambda[static_cast<std::size_t>(i)] * lambda_bar[static_cast<std::size_t>(i)];
    for (Offset k = view.env_dof_offsets[env]; k < view.env_dof_offsets[env + 1]; ++k)
      found.loss[e] += solution.velocity[static_cast<std::size_t>(k)] * v_bar[static_cast<std::size_t>(k)];
  }
  JacobianBatchCotangentView<double> to;
  if (gradients != nullptr) {
    const Offset sizes[] = {view.entry_count, view.mass_count, view.dof_count,
                            view.row_count,   view.row_count,  view.row_count};
    double** const targets[] = {&to.J, &to.M, &to.v_free, &to.target, &to.R, &to.mu};
    for (std::size_t p = 0; p < gradients->size(); ++p) {
      (*gradients)[p].gradient.resize(static_cast<std::size_t>(sizes[p]));
      *targets[p] = (*gradients)[p].gradient.data();
    }
  }
  DerivativeOptions options;
  options.max_unknowns = 4096;
  Derivative(Device::cpu(), options)
      .vjp(view, ReactionView<double>{solution.contact.lambda.data(), nullptr},
           JacobianSolutionCotangentView<double>{lambda_bar.data(), nullptr, v_bar.data()}, to, found.modes.data());
  return found;
}

/// What was found of one parameter of one case.
struct Errors {
  Numbers relative;
  std::size_t left_out = 0;  ///< with a contact in another mode at every step, or refused
};

void report(const std::string& name, const std::string& parameter, Errors errors, Csv* csv) {
  std::sort(errors.relative.begin(), errors.relative.end());
  const std::size_t count = errors.relative.size();
  if (count == 0) errors.relative.push_back(std::nan(""));
  const double median = errors.relative[count / 2], most = errors.relative.back();
  std::printf("%-16s %-8s %6zu %8zu %10.1e %10.1e\n", name.c_str(), parameter.c_str(), count, errors.left_out, median,
              most);
  std::fflush(stdout);
  if (csv != nullptr)
    csv->row(
        {name, parameter, std::to_string(count), std::to_string(errors.left_out), number(median, 2), number(most, 2)});
}

/// The environments at which no contact is in another mode at one of three solutions.
bool is_smooth(const Solved& at, const Solved& up, const Solved& down, std::size_t e) {
  const Solved* const all[] = {&at, &up, &down};
  return std::all_of(std::begin(all), std::end(all), [&](const Solved* one) {
    return one->status[e].code == EnvCode::solved && (one->modes[e].flags & kGradientRefused) == 0 &&
           one->modes[e].degenerate == 0 && one->modes[e].unknowns == at.modes[e].unknowns;
  });
}

/// The smallest error of each environment over the steps: the longest err by curvature, the shortest by rounding.
Errors compare(const JacobianCase& own, const Parameter& parameter, const Solved& at, const Numbers& lambda_bar,
               const Numbers& v_bar, const Numbers& steps, scenes::Rng& rng) {
  std::vector<Numbers> directions;
  for (const Env& env : own.envs) directions.push_back(direction_of(env, parameter, own.mass_block, rng));
  Numbers expected, size;
  Offset first = 0;
  for (const Numbers& direction : directions) {
    expected.push_back(0.0);
    size.push_back(0.0);
    for (const double along : direction) {
      const double term = parameter.gradient[static_cast<std::size_t>(first++)] * along;
      expected.back() += term;
      size.back() += std::abs(term);
    }
  }
  Numbers best(own.envs.size(), -1.0);
  for (const double step : steps) {
    const Solved up = solve_case(moved(own, parameter.numbers, directions, step), lambda_bar, v_bar, nullptr);
    const Solved down = solve_case(moved(own, parameter.numbers, directions, -step), lambda_bar, v_bar, nullptr);
    for (std::size_t e = 0; e < best.size(); ++e) {
      if (!(size[e] > 0.0) || !is_smooth(at, up, down, e)) continue;
      const double error = std::abs((up.loss[e] - down.loss[e]) / (2 * step) - expected[e]) / size[e];
      best[e] = best[e] < 0.0 ? error : std::min(best[e], error);
    }
  }
  Errors errors;
  for (std::size_t e = 0; e < best.size(); ++e) {
    if (best[e] >= 0.0)
      errors.relative.push_back(best[e]);
    else if (size[e] > 0.0 || at.modes[e].flags != 0)
      ++errors.left_out;
  }
  return errors;
}

void compare(const JacobianCase& own, const Numbers& steps, Csv* csv) {
  const auto batch = own.batch<double>(own.envs.size());
  const auto view = batch.view();
  scenes::Rng rng(7);
  Numbers lambda_bar(static_cast<std::size_t>(view.row_count)), v_bar(static_cast<std::size_t>(view.dof_count));
  for (Numbers* const bar : {&lambda_bar, &v_bar})
    for (double& number : *bar) number = rng.symmetric(1.0);
  std::vector<Parameter> parameters{{"J", &Env::J, {}},           {"M", &Env::M, {}}, {"v_free", &Env::v_free, {}},
                                    {"target", &Env::target, {}}, {"R", &Env::R, {}}, {"mu", &Env::mu, {}}};
  const Solved at = solve_case(own, lambda_bar, v_bar, &parameters);
  for (const Parameter& parameter : parameters)
    report(own.name, parameter.name, compare(own, parameter, at, lambda_bar, v_bar, steps, rng), csv);
}

}  // namespace

int run(int argc, char** argv) {
  const Arguments arguments(argc, argv,
                            {{"--folder", "examples/data"},
                             {"--files", "humanoid,hand_cube,quadruped_rough"},
                             {"--envs", "20"},
                             {"--steps", "1e-4,1e-5,1e-6"}});
  const auto csv = arguments.csv("case,parameter,compared,left_out,median,largest");
  std::printf("%-16s %-8s %6s %8s %10s %10s\n", "case", "by", "envs", "left out", "median", "largest");
  for (const std::string& file : arguments.texts("--files"))
    compare(recorded_case(arguments.text("--folder") + "/" + file + ".h5",
                          static_cast<std::size_t>(arguments.count("--envs"))),
            arguments.numbers("--steps"), csv.get());
  return EXIT_SUCCESS;
}

}  // namespace stiction::bench
