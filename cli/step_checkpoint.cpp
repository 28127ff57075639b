#include "cli/step_checkpoint.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <sstream>
#include <vector>

#include "cli/convert_values.hpp"
#include "stiction/error.hpp"
#include "stiction/io.hpp"

namespace stiction::cli {

namespace {

/// "name=value" of a run, each, by name.
std::map<std::string, std::string> words_of(const std::string& run) {
  std::map<std::string, std::string> words;
  std::istringstream text(run);
  for (std::string word; text >> word;) {
    const std::size_t equals = std::min(word.find('='), word.size());
    words[word.substr(0, equals)] = word.substr(std::min(equals + 1, word.size()));
  }
  return words;
}

/// Lists arguments in which two runs differ: "--envs is 2 in the file and 3 here, ...".
std::string differences(const std::string& file, const std::string& here) {
  std::map<std::string, std::array<std::string, 2>> values;
  for (const auto& [name, value] : words_of(file)) values[name][0] = value;
  for (const auto& [name, value] : words_of(here)) values[name][1] = value;
  const auto option = [](const std::string& name) {
    if (name == "scene") return std::string("SCENE");
    if (name == "epoch") return std::string("the numerics epoch");
    return "--" + (name == "environments" ? "envs" : name);
  };
  const auto told = [](const std::string& value) { return value.empty() ? "not given" : value; };
  std::vector<std::string> all;
  for (const auto& [name, both] : values)
    if (both[0] != both[1])
      all.push_back(fmt::format("{} is {} in the file and {} here", option(name), told(both[0]), told(both[1])));
  return fmt::format("{}", fmt::join(all, ", "));
}

template <class Real>
constexpr Precision kPrecision = sizeof(Real) == sizeof(float) ? Precision::f32 : Precision::f64;

}  // namespace

template <class To, class From>
WorldCheckpoint<To> converted(const WorldCheckpoint<From>& from) {
  return {convert_values<To>(from.position),
          convert_values<To>(from.orientation),
          convert_values<To>(from.twist),
          convert_values<To>(from.wrench),
          from.contact_offsets,
          from.contact_id,
          convert_values<To>(from.impulse)};
}

StepCheckpoint::StepCheckpoint(const StepArguments& arguments, const WorldOptions& options)
    : arguments_(arguments),
      run_(fmt::format("scene={} environments={} seed={} dt={} solver={} preconditioner={} iterations={} tolerance={} "
                       "warm-start={} max-contacts={} precision={} epoch={}{}",
                       arguments.scene, arguments.environments, arguments.seed, options.stepping.dt, arguments.solver,
                       arguments.preconditioner.value_or("none"), arguments.iterations, arguments.tolerance,
                       arguments.warm_start, arguments.max_contacts, arguments.precision, kNumericsEpoch,
                       arguments.size > 0 ? fmt::format(" size={}", arguments.size) : "")) {
  if (arguments.law != StepArguments{}.law) run_ += " law=" + arguments.law;
  if (arguments.blocks != StepArguments{}.blocks) run_ += " blocks=" + arguments.blocks;
}

const std::filesystem::path* StepCheckpoint::path() const {
  return arguments_.checkpoint ? &*arguments_.checkpoint : nullptr;
}

bool StepCheckpoint::is_there() const {
  return path() != nullptr && std::filesystem::exists(*path());
}

void StepCheckpoint::check() const {
  const io::CheckpointHead head = io::read_checkpoint_head(*path());
  const std::string name = path()->filename().string();
  if (head.run != run_)
    throw Error(ErrorCode::bad_file,
                fmt::format("{}: is of another run: {}; give what the file has, name another file, or remove it", name,
                            differences(head.run, run_)));
  if (head.step > arguments_.steps)
    throw Error(ErrorCode::bad_file, fmt::format("{}: holds step {}, beyond --steps {}; ask for more steps", name,
                                                 head.step, arguments_.steps));
}

std::optional<io::CheckpointShare> StepCheckpoint::read(io::CheckpointBodies bodies) const {
  if (!is_there()) return std::nullopt;
  check();
  return io::read_checkpoint(*path(), arguments_.environments, bodies);
}

template <class Real>
std::int64_t StepCheckpoint::resume(World<Real>& world) const {
  if (!is_there()) return 0;
  check();
  const io::CheckpointFile file = io::read_checkpoint(*path());
  world.resume(converted<Real>(file.world));
  return file.step;
}

bool StepCheckpoint::is_due(std::int64_t step) const {
  return path() != nullptr && (step == arguments_.steps || step % arguments_.checkpoint_every == 0);
}

template <class Real>
void StepCheckpoint::after(std::int64_t step, const World<Real>& world) const {
  if (is_due(step)) io::write_checkpoint(*path(), file_of(step, world.checkpoint()));
}

template <class Real>
io::CheckpointFile StepCheckpoint::file_of(std::int64_t step, const WorldCheckpoint<Real>& world) const {
  return {kPrecision<Real>, run_, step, converted<double>(world)};
}

template WorldCheckpoint<float> converted(const WorldCheckpoint<double>&);
template WorldCheckpoint<double> converted(const WorldCheckpoint<double>&);
template WorldCheckpoint<double> converted(const WorldCheckpoint<float>&);
template io::CheckpointFile StepCheckpoint::file_of(std::int64_t, const WorldCheckpoint<float>&) const;
template io::CheckpointFile StepCheckpoint::file_of(std::int64_t, const WorldCheckpoint<double>&) const;
template std::int64_t StepCheckpoint::resume(World<float>&) const;
template std::int64_t StepCheckpoint::resume(World<double>&) const;
template void StepCheckpoint::after(std::int64_t, const World<float>&) const;
template void StepCheckpoint::after(std::int64_t, const World<double>&) const;

}  // namespace stiction::cli
