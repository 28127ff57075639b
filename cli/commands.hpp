#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "stiction/solver.hpp"
#include "stiction/types.hpp"

namespace stiction::cli {

/// Exit statuses of every command. Bad input or usage is thrown and becomes kExitBadInput in main().
inline constexpr int kExitDone = 0;
inline constexpr int kExitMissed = 1;    ///< an environment missed the tolerance, or a difference was found
inline constexpr int kExitBadInput = 2;  ///< bad input or usage, with one sentence on stderr

/// Version of the JSON reports (docs/reference/cli.md); it changes when a key changes its name or meaning.
inline constexpr int kReportSchemaVersion = 2;

struct InfoArguments {
  bool json = false;
};

struct GenerateArguments {
  bool list = false;
  std::string scene;
  std::int64_t environments = 1;
  std::uint64_t seed = 0;
  int size = 0;     ///< 0: the scene's default
  int threads = 0;  ///< 0: all cores
  bool box_friction = false;
  std::filesystem::path output;
  bool quiet = false;
};

struct InspectArguments {
  std::filesystem::path batch;
  bool json = false;
  std::optional<std::filesystem::path> graph;
  std::optional<std::int64_t> environment;
};

struct SolveArguments {
  std::filesystem::path batch;
  std::optional<std::string> solver, preset;  ///< without either: npgs, auto of J and M, or newton of bodies
  std::optional<std::string> preconditioner;  ///< of newton of bodies
  std::string device = "auto";
  std::string precision = "f64";
  std::string law = "file";
  std::string form = "matrix";  ///< form that is solved: matrix (A), jacobian (J and M), or bodies (of J and M)
  std::string islands = "together";
  std::string choose = "named";
  std::string blocks = "cones";
  std::optional<double> tolerance;
  double absolute_tolerance = 0.0;
  std::optional<Index> max_iterations;
  double omega = 1.0;
  Index direct_rows = SolverOptions{}.direct_rows;
  int threads = 0;
  int repeat = 1;             ///< solves, of which the shortest is reported
  int pyramid = 0;            ///< sides of the pyramids that replace friction cones; 0: cones stay
  bool asynchronous = false;  ///< sweeps of bodies by threads that wait for no colour
  bool isolate = false;
  bool quiet = false;
  std::optional<std::uint64_t> permute;
  std::optional<std::string> shard;  ///< "I/N": part I of N of the environments, from 0
  std::optional<std::filesystem::path> warm_start, output, json, trace, convergence, record;
  std::string record_when = "failed";
};

struct ReplayArguments {
  std::filesystem::path recording;
  std::string device = "auto";
  int threads = 0;  ///< 0: all cores
  bool quiet = false;
};

struct VerifyArguments {
  std::filesystem::path batch, solution;
  std::string law = "file";
  double tolerance = 1e-6, absolute_tolerance = 0;
  bool json = false;
};

struct HashArguments {
  std::filesystem::path solution;
  bool per_environment = false;
};

struct DiffArguments {
  std::filesystem::path left, right;
};

struct MergeArguments {
  std::filesystem::path output;
  std::vector<std::filesystem::path> parts;
  bool quiet = false;
};

struct ConvertArguments {
  std::filesystem::path input, output;
  std::string to;  ///< "batch", "fclib" or empty: by the output's extension
  std::optional<std::int64_t> environment;
};

struct StepArguments {
  bool list = false;
  std::string scene;
  int size = 0;  ///< bodies of an environment; 0: the scene's
  std::int64_t environments = 4096;
  std::int64_t steps = 200;
  std::uint64_t seed = 0;
  std::optional<double> dt;  ///< without it: the scene's
  std::string device = "auto";
  std::string precision = "f64";
  std::string solver = "si";                  ///< si, npgs, pgs, newton or multigrid
  std::optional<std::string> preconditioner;  ///< of newton; without it: block_diagonal
  std::string law = "coulomb";                ///< coulomb, convex or boxed
  std::string blocks = "cones";               ///< of sweeps: cones or pairs
  Index iterations = 50;
  double tolerance = 1e-3;
  double warm_start = 0.95;
  Index max_contacts = 0;
  int threads = 0;
  std::int64_t every = 0;  ///< states of every so many steps are written; 0: those of the last
  std::int64_t checkpoint_every = 100;
  bool quiet = false;
  std::optional<std::int64_t> hashed;  ///< environments, the first, that the hash is of; without it: all
  std::optional<std::filesystem::path> output, json, checkpoint;
};

struct ScalingArguments {
  std::string target;        ///< a contact-batch or FCLIB file, or else a scene of stiction step
  std::vector<int> threads;  ///< empty: 1, 2, 4 ... and all cores
  bool weak = false;
  int repeat = 3;  ///< runs for each number of threads, of which the shortest counts
  std::optional<std::string> solver;
  std::string precision = "f64";
  std::optional<double> tolerance;
  std::optional<Index> max_iterations;
  std::int64_t environments = 1024;  ///< of a scene
  std::int64_t steps = 20;           ///< of a scene
  std::uint64_t seed = 0;            ///< of a scene
  std::optional<std::filesystem::path> json;
  bool quiet = false;
};

/// One function a command, each in the file of its name. They return an exit status and throw stiction::Error.
int run_info(const InfoArguments& arguments);
int run_generate(const GenerateArguments& arguments);
int run_inspect(const InspectArguments& arguments);
int run_solve(const SolveArguments& arguments);
int run_replay(const ReplayArguments& arguments);
int run_verify(const VerifyArguments& arguments);
int run_hash(const HashArguments& arguments);
int run_diff(const DiffArguments& arguments);
int run_merge(const MergeArguments& arguments);
int run_convert(const ConvertArguments& arguments);
int run_step(const StepArguments& arguments);
int run_scaling(const ScalingArguments& arguments);

}  // namespace stiction::cli
