#include "tools/cli/step_checkpoint.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <vector>

#include "stiction/error.hpp"
#include "stiction/io.hpp"

namespace stiction::cli {

namespace {

template <class To, class From>
std::vector<To> numbers(const std::vector<From>& values) {
  std::vector<To> all;
  all.reserve(values.size());
  for (const From value : values) all.push_back(static_cast<To>(value));
  return all;
}

template <class Real>
constexpr Precision kPrecision = sizeof(Real) == sizeof(float) ? Precision::f32 : Precision::f64;

}  // namespace

template <class To, class From>
WorldCheckpoint<To> converted(const WorldCheckpoint<From>& from) {
  return {numbers<To>(from.position), numbers<To>(from.orientation), numbers<To>(from.twist),
          numbers<To>(from.wrench),   from.contact_offsets,          from.contact_id,
          numbers<To>(from.impulse)};
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
}

const std::filesystem::path* StepCheckpoint::path() const {
  return arguments_.checkpoint ? &*arguments_.checkpoint : nullptr;
}

bool StepCheckpoint::is_there() const {
  return path() != nullptr && std::filesystem::exists(*path());
}

void StepCheckpoint::check(const std::filesystem::path& path, const std::string& run, std::int64_t step) const {
  const std::string name = path.filename().string();
  if (run != run_)
    throw Error(ErrorCode::bad_file, fmt::format("{}: is of another run: it holds {}, and this one is {}; choose "
                                                 "another file, or remove it",
                                                 name, run, run_));
  if (step > arguments_.steps)
    throw Error(ErrorCode::bad_file,
                fmt::format("{}: holds step {}, beyond --steps {}; ask for more steps", name, step, arguments_.steps));
}

std::optional<io::CheckpointShare> StepCheckpoint::read(io::CheckpointBodies bodies) const {
  if (!is_there()) return std::nullopt;
  io::CheckpointShare share = io::read_checkpoint(*path(), arguments_.environments, bodies);
  check(*path(), share.file.run, share.file.step);
  return share;
}

template <class Real>
std::int64_t StepCheckpoint::resume(World<Real>& world) const {
  if (!is_there()) return 0;
  const io::CheckpointFile file = io::read_checkpoint(*path());
  check(*path(), file.run, file.step);
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
