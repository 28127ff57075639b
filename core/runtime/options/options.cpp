#include <cmath>
#include <string>
#include <utility>

#include "core/job/workspace.hpp"
#include "core/runtime/check/check_options.hpp"
#include "stiction/error.hpp"

namespace stiction {

namespace {

void check_rules(const SpectrumRules& rules) {
  const auto fail = [](const std::string& message) { throw Error(ErrorCode::invalid_argument, message); };
  if (rules.steps < 2 || rules.steps > 1000)
    fail("spectrum.steps = " + std::to_string(rules.steps) + ": must be from 2 to 1000");
  if (rules.direct_rows < 0)
    fail("spectrum.direct_rows = " + std::to_string(rules.direct_rows) + ": must be >= 0 (0: none is solved directly)");
  for (const auto& [name, value] : {std::pair("direct_condition", rules.direct_condition),
                                    {"preconditioned_condition", rules.preconditioned_condition},
                                    {"sparse_density", rules.sparse_density}})
    if (!(value >= 0))
      fail("spectrum." + std::string(name) + " = " + std::to_string(value) + ": must be >= 0 (0: no environment)");
  for (const auto& [name, solver] : {std::pair("direct", rules.direct),
                                     {"preconditioned", rules.preconditioned},
                                     {"decomposed", rules.decomposed},
                                     {"otherwise", rules.otherwise}})
    if (solver == SolverKind::multigrid || solver == SolverKind::velocity_newton)
      fail("spectrum." + std::string(name) + " = " + to_string(solver) +
           ": does not work on contact batches; name one that does, or auto");
}

void check_blocks(const SolverOptions& options) {
  const auto fail = [](const std::string& message) { throw Error(ErrorCode::invalid_argument, message); };
  const BlockMode blocks = options.blocks;
  if (blocks != BlockMode::cones && blocks != BlockMode::pairs && blocks != BlockMode::strong)
    fail("blocks = " + std::to_string(static_cast<int>(blocks)) +
         ": no such mode; use BlockMode::cones, pairs or strong");
  if (blocks == BlockMode::cones) return;
  if (options.choose != SolverChoice::named)
    fail(std::string("blocks = ") + to_string(blocks) +
         " with choose = spectrum: blocks are of sweeps; name pgs, npgs or nsgs, or leave blocks = cones");
  if (options.solver != SolverKind::pgs && options.solver != SolverKind::npgs && options.solver != SolverKind::nsgs)
    fail(std::string("blocks = ") + to_string(blocks) + " with solver = " + to_string(options.solver) +
         ": blocks are of sweeps; choose pgs, npgs or nsgs, or leave blocks = cones");
}

}  // namespace

void check_options(const SolverOptions& options) {
  const auto fail = [](const std::string& message) { throw Error(ErrorCode::invalid_argument, message); };
  if (!(options.tolerance >= 0.0) || !std::isfinite(options.tolerance))
    fail("tolerance = " + std::to_string(options.tolerance) + ": must be finite and >= 0 (0 runs all iterations)");
  if (!(options.absolute_tolerance >= 0.0) || !std::isfinite(options.absolute_tolerance))
    fail("absolute_tolerance = " + std::to_string(options.absolute_tolerance) + ": must be finite and >= 0");
  if (options.max_iterations < 0) fail("max_iterations = " + std::to_string(options.max_iterations) + ": must be >= 0");
  if (options.stall_window < 0)
    fail("stall_window = " + std::to_string(options.stall_window) + ": must be >= 0 (0 never gives up)");
  if (!(options.omega > 0.0 && options.omega < 2.0))
    fail("omega = " + std::to_string(options.omega) + ": relaxation converges only for 0 < omega < 2");
  if (options.threads < 0) fail("threads = " + std::to_string(options.threads) + ": must be >= 0 (0 takes all cores)");
  if (options.solver == SolverKind::multigrid)
    fail(
        "solver = multigrid: works on bodies, not on contact batches; give the bodies to a BodySolver with "
        "BodyMethod::newton (docs/howto/bodies.md), or choose ipm or newton here");
  if (options.solver == SolverKind::velocity_newton)
    fail("solver = velocity_newton: works on J and M alone; a JacobianSolver with solver auto takes it");
  if (options.direct_rows < kDirectRows || options.direct_rows > kMostDirectRows)
    fail("direct_rows = " + std::to_string(options.direct_rows) + ": must be from " + std::to_string(kDirectRows) +
         " to " + std::to_string(kMostDirectRows));
  if (options.direct_rows != kDirectRows &&
      (options.solver == SolverKind::automatic || options.choose == SolverChoice::spectrum))
    fail("direct_rows = " + std::to_string(options.direct_rows) + ": solver auto chooses for matrices of up to " +
         std::to_string(kDirectRows) + " rows; name a solver, or leave direct_rows as it is");
  check_rules(options.spectrum);
  if (options.choose != SolverChoice::named && options.choose != SolverChoice::spectrum)
    fail("choose = " + std::to_string(static_cast<int>(options.choose)) +
         ": no such choice; use SolverChoice::named or spectrum");
  if (options.islands != IslandMode::together && options.islands != IslandMode::apart)
    fail("islands = " + std::to_string(static_cast<int>(options.islands)) +
         ": no such mode; use IslandMode::together or apart");
  check_blocks(options);
}

const char* to_string(IslandMode mode) noexcept {
  switch (mode) {
    case IslandMode::together:
      return "together";
    case IslandMode::apart:
      return "apart";
  }
  return "unknown";
}

IslandMode island_mode_from_string(const std::string& name) {
  for (const IslandMode mode : {IslandMode::together, IslandMode::apart})
    if (name == to_string(mode)) return mode;
  throw Error(ErrorCode::invalid_argument, "island mode '" + name + "' is not known; use one of: together, apart");
}

const char* to_string(BlockMode mode) noexcept {
  switch (mode) {
    case BlockMode::cones:
      return "cones";
    case BlockMode::pairs:
      return "pairs";
    case BlockMode::strong:
      return "strong";
  }
  return "unknown";
}

BlockMode block_mode_from_string(const std::string& name) {
  for (const BlockMode mode : {BlockMode::cones, BlockMode::pairs, BlockMode::strong})
    if (name == to_string(mode)) return mode;
  throw Error(ErrorCode::invalid_argument, "block mode '" + name + "' is not known; use one of: cones, pairs, strong");
}

}  // namespace stiction
