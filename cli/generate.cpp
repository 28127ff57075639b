#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <exception>
#include <mutex>
#include <thread>

#include "cli/commands.hpp"
#include "cli/make_scene.hpp"
#include "cli/memory.hpp"
#include "cli/output.hpp"
#include "cli/progress.hpp"
#include "scenes/scenes.hpp"
#include "stiction/box_friction.hpp"
#include "stiction/error.hpp"
#include "stiction/io.hpp"

namespace stiction::cli {

namespace {

/// Environments made before any is appended: bounds the memory that waits, and keeps the threads busy.
constexpr std::int64_t kChunk = 256;

Law law_of_scene(const std::string& name) {
  std::vector<std::string> names;
  for (const scenes::SceneInfo& scene : scenes::list()) {
    if (scene.name == name) return scene.law;
    names.push_back(scene.name);
  }
  throw Error(ErrorCode::invalid_argument,
              fmt::format("scene '{}' is not known; there are {}", name, fmt::join(names, ", ")));
}

/// Environments first .. first + count - 1, made by several threads; an environment depends on its index alone, so
/// the threads reach nothing but the time.
std::vector<scenes::SceneEnv> make_chunk(const GenerateArguments& arguments, std::int64_t first, std::int64_t count,
                                         unsigned threads, Progress& progress) {
  std::vector<scenes::SceneEnv> chunk(static_cast<std::size_t>(count));
  std::atomic<std::int64_t> next{0};
  std::exception_ptr failure;
  std::mutex failure_mutex;
  const auto work = [&] {
    try {
      for (std::int64_t i = next++; i < count; i = next++) {
        chunk[static_cast<std::size_t>(i)] =
            scenes::make(arguments.scene, arguments.seed, static_cast<std::uint64_t>(first + i), arguments.size);
        progress.advance();
      }
    } catch (...) {
      const std::lock_guard lock(failure_mutex);
      failure = std::current_exception();
      next = count;
    }
  };
  std::vector<std::thread> team;
  for (unsigned i = 1; i < threads; ++i) team.emplace_back(work);
  work();
  for (std::thread& thread : team) thread.join();
  if (failure) std::rethrow_exception(failure);
  return chunk;
}

double bytes_of(const scenes::Csr& matrix) {
  return static_cast<double>(matrix.ptr.size() * sizeof(Index) + matrix.val.size() * (sizeof(Index) + sizeof(double)));
}

/// Returns the bytes a batch keeps of an environment: entries of A, J and M, and b and v_free.
double bytes_of(const scenes::SceneEnv& env) {
  const double columns = static_cast<double>(env.system.A.size()) * (sizeof(Index) + sizeof(double));
  const double rows = static_cast<double>(env.system.b.size() + env.v_free.size()) * sizeof(double);
  return columns + rows + bytes_of(env.J) + bytes_of(env.M);
}

/// Appends rows whose columns count from their own environment's first degree of freedom.
void append(io::Csr& matrix, const scenes::Csr& rows) {
  const Offset base = matrix.ptr.back();
  for (std::size_t row = 1; row < rows.ptr.size(); ++row) matrix.ptr.push_back(base + rows.ptr[row]);
  matrix.col.insert(matrix.col.end(), rows.col.begin(), rows.col.end());
  matrix.val.insert(matrix.val.end(), rows.val.begin(), rows.val.end());
}

void append(io::Recording& recording, const scenes::SceneEnv& env) {
  recording.batch.add(env.system);
  recording.env_dof_offsets.push_back(recording.env_dof_offsets.back() + env.dof_count);
  append(recording.J, env.J);
  append(recording.M, env.M);
  recording.v_free.insert(recording.v_free.end(), env.v_free.begin(), env.v_free.end());
  recording.row_target.insert(recording.row_target.end(), env.row_target.begin(), env.row_target.end());
}

int list_scenes() {
  for (const scenes::SceneInfo& scene : scenes::list()) {
    fmt::print("{:<12} {:<8} {}\n", scene.name, to_string(scene.law), scene.summary);
  }
  return kExitDone;
}

}  // namespace

io::Recording make_scene(const GenerateArguments& arguments) {
  io::Recording recording;
  recording.batch = ContactBatch<double>(law_of_scene(arguments.scene));
  recording.env_dof_offsets.push_back(0);
  recording.J.ptr.push_back(0);
  recording.M.ptr.push_back(0);
  recording.source = fmt::format("stiction {} generate {} --envs {} --seed {}", kVersion, arguments.scene,
                                 arguments.environments, arguments.seed);
  if (arguments.size != 0) recording.source += fmt::format(" --size {}", arguments.size);
  if (arguments.box_friction) recording.source += " --box-friction";
  const unsigned threads = arguments.threads > 0 ? static_cast<unsigned>(arguments.threads)
                                                 : std::max(1U, std::thread::hardware_concurrency());
  if (arguments.environments > kChunk) {  // else what is waited for would be made twice
    const double one = bytes_of(scenes::make(arguments.scene, arguments.seed, 0, arguments.size));
    require_memory(one * static_cast<double>(arguments.environments),
                   fmt::format("{} with {} environments (--envs)", arguments.scene, arguments.environments));
  }
  Progress progress("generating", arguments.environments, arguments.quiet);
  for (std::int64_t first = 0; first < arguments.environments; first += kChunk) {
    const std::int64_t count = std::min(kChunk, arguments.environments - first);
    for (const scenes::SceneEnv& env : make_chunk(arguments, first, count, threads, progress)) append(recording, env);
  }
  if (arguments.box_friction) recording.batch = with_box_friction(recording.batch);
  return recording;
}

int run_generate(const GenerateArguments& arguments) {
  if (arguments.list) return list_scenes();
  if (arguments.scene.empty() || arguments.output.empty()) {
    throw Error(ErrorCode::invalid_argument, "generate needs a SCENE and -o BATCH; --list shows the scenes");
  }
  law_of_scene(arguments.scene);
  require_replaceable(arguments.output);
  const io::Recording recording = make_scene(arguments);
  {
    const Progress progress("writing", 0, arguments.quiet);
    io::write_batch(arguments.output, recording);
  }
  if (!arguments.quiet) {
    fmt::print("{}: {} environments, {} rows, {} cones, law {}\n", arguments.output.string(),
               recording.batch.env_count(), recording.batch.row_count(), recording.batch.view().cone_count,
               to_string(recording.batch.law()));
  }
  return kExitDone;
}

}  // namespace stiction::cli
