#include "distributed/program/job_problem.hpp"

#include <fmt/format.h>

#include <optional>
#include <span>
#include <type_traits>
#include <utility>

#include "cli/convert_values.hpp"
#include "cli/load.hpp"
#include "cli/make_scene.hpp"
#include "distributed/program/column.hpp"
#include "scenes/body_scenes.hpp"
#include "stiction/error.hpp"
#include "stiction/io.hpp"

namespace stiction::distributed {

namespace {

/// J and M as a file or a scene of `stiction generate` has them.
io::Recording recording_of(const SolveArguments& arguments, const std::optional<Law>& law) {
  if (!arguments.batch.empty())
    return cli::load_batch(arguments.batch, law, cli::ValueDefects::refuse, SolverKind::automatic).recording;
  cli::GenerateArguments scene;
  scene.scene = arguments.scene;
  scene.environments = arguments.environments;
  scene.seed = arguments.seed;
  scene.size = arguments.size;
  scene.threads = 1;
  scene.quiet = true;
  io::Recording recording = cli::make_scene(scene);
  if (law) recording.batch.set_law(*law);
  return recording;
}

template <class Real>
JobProblem<Real> from_matrices(const SolveArguments& arguments, const std::optional<Law>& law) {
  const io::Recording recording = recording_of(arguments, law);
  JobProblem<Real> problem;
  problem.bodies = as_bodies(io::jacobian_batch<Real>(recording).view());
  problem.law = recording.batch.law();
  problem.env_row_offsets = recording.batch.arrays().env_row_offsets;
  if (arguments.warm_start) {
    const std::vector<Real> first =
        cli::convert_values<Real>(cli::load_solution(*arguments.warm_start, recording.batch).lambda);
    problem.first = to_contacts(problem.bodies, std::span<const Real>(first));
  }
  return problem;
}

template <class Real>
JobProblem<Real> column(const SolveArguments& arguments) {
  const ColumnScene scene = column_scene(arguments);
  JobProblem<Real> problem;
  problem.env_row_offsets = {0};
  for (std::int64_t env = 0; env < arguments.environments; ++env) {
    const BodyEnvironment<double> made =
        scenes::make_body_column(column_seed(arguments, env), scene.side, scene.layers);
    if constexpr (std::is_same_v<Real, double>) {
      problem.bodies.batch.add(made);
    } else {
      problem.bodies.batch.add(scenes::rounded(made));
    }
    problem.env_row_offsets.push_back(3 * problem.bodies.batch.contact_count());
  }
  problem.bodies.stepping = scene.stepping;
  problem.law = scene.law;
  if (arguments.warm_start) {
    problem.first = cli::convert_values<Real>(io::read_solution(*arguments.warm_start).lambda);
    if (problem.first.size() != static_cast<std::size_t>(problem.env_row_offsets.back()))
      throw Error(
          ErrorCode::invalid_argument,
          fmt::format("{}: has {} rows, and the scene has {}; give a solution of this scene, size and seed",
                      arguments.warm_start->filename().string(), problem.first.size(), problem.env_row_offsets.back()));
  }
  return problem;
}

}  // namespace

template <class Real>
std::vector<Real> JobProblem<Real>::rows(std::vector<Real> by_contact) const {
  return bodies.tangents.empty() ? std::move(by_contact) : to_rows(bodies, std::span<const Real>(by_contact));
}

template <class Real>
JobProblem<Real> job_problem(const SolveArguments& arguments) {
  if (arguments.batch.empty() == arguments.scene.empty())
    throw Error(ErrorCode::invalid_argument, "give a BATCH or --scene, one of them");
  return arguments.scene == kColumn ? column<Real>(arguments)
                                    : from_matrices<Real>(arguments, cli::law_from_option(arguments.law));
}

template struct JobProblem<float>;
template struct JobProblem<double>;
template JobProblem<float> job_problem(const SolveArguments&);
template JobProblem<double> job_problem(const SolveArguments&);

}  // namespace stiction::distributed
