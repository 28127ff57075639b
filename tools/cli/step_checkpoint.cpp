#include "tools/cli/step_checkpoint.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <vector>

#include "stiction/error.hpp"
#include "stiction/io.hpp"

namespace stiction::cli {

namespace {

template <class To, class From>
std::vector<To> converted(const std::vector<From>& values) {
  std::vector<To> all;
  all.reserve(values.size());
  for (const From value : values) all.push_back(static_cast<To>(value));
  return all;
}

/// Exact where `To` holds the numbers.
template <class To, class From>
WorldCheckpoint<To> converted(const WorldCheckpoint<From>& from) {
  return {converted<To>(from.position), converted<To>(from.orientation),
          converted<To>(from.twist),    converted<To>(from.wrench),
          from.contact_offsets,         from.contact_id,
          converted<To>(from.impulse)};
}

template <class Real>
constexpr Precision kPrecision = sizeof(Real) == sizeof(float) ? Precision::f32 : Precision::f64;

}  // namespace

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

template <class Real>
std::int64_t StepCheckpoint::resume(World<Real>& world) const {
  if (!arguments_.checkpoint || !std::filesystem::exists(*arguments_.checkpoint)) return 0;
  const io::CheckpointFile file = io::read_checkpoint(*arguments_.checkpoint);
  const std::string name = arguments_.checkpoint->filename().string();
  if (file.run != run_)
    throw Error(ErrorCode::bad_file, fmt::format("{}: is of another run: it holds {}, and this one is {}; choose "
                                                 "another file, or remove it",
                                                 name, file.run, run_));
  if (file.step > arguments_.steps)
    throw Error(ErrorCode::bad_file, fmt::format("{}: holds step {}, beyond --steps {}; ask for more steps", name,
                                                 file.step, arguments_.steps));
  world.resume(converted<Real>(file.world));
  return file.step;
}

template <class Real>
void StepCheckpoint::after(std::int64_t step, const World<Real>& world) const {
  if (!arguments_.checkpoint || arguments_.checkpoint_read_only) return;
  if (step != arguments_.steps && step % arguments_.checkpoint_every != 0) return;
  io::write_checkpoint(*arguments_.checkpoint, {kPrecision<Real>, run_, step, converted<double>(world.checkpoint())});
}

template std::int64_t StepCheckpoint::resume(World<float>&) const;
template std::int64_t StepCheckpoint::resume(World<double>&) const;
template void StepCheckpoint::after(std::int64_t, const World<float>&) const;
template void StepCheckpoint::after(std::int64_t, const World<double>&) const;

}  // namespace stiction::cli
