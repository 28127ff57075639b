#include "stiction/articulated.hpp"

#include <array>
#include <string>
#include <utility>

#include "core/base/extents.hpp"
#include "core/base/fp_env.hpp"
#include "core/machine/articulated_machine.hpp"
#include "core/runtime/articulated/articulated_model.hpp"
#include "core/runtime/articulated/varied_arrays.hpp"
#include "core/runtime/check/defects.hpp"
#include "core/runtime/check/expect.hpp"
#include "stiction/hash.hpp"

namespace stiction {

namespace {

/// Steps in single precision end at rounding below this.
constexpr double kLeastSingleTolerance = 1e-5;

template <class Real>
void check_options(const ArticulatedOptions& options) {
  const double least = sizeof(Real) == sizeof(float) ? kLeastSingleTolerance : 0.0;
  if (!(options.tolerance > 0) || options.tolerance < least)
    refuse("tolerance = " + shortest_text(options.tolerance) + ": must be > 0, and in single precision at least 1e-5");
  if (options.max_iterations <= 0)
    refuse("max_iterations = " + std::to_string(options.max_iterations) + ": must be > 0");
  if (options.threads < 0) refuse("threads = " + std::to_string(options.threads) + ": must be >= 0");
  for (const VariedArray one : options.varies)
    if (static_cast<std::size_t>(one) >= kVariedArrays)
      refuse("varies holds " + std::to_string(static_cast<unsigned>(one)) + ": must be values of VariedArray");
}

template <class Real>
std::unique_ptr<ArticulatedMachine<Real>> make_machine(Device device, const ArticulatedJob<Real>& job, Offset env_count,
                                                       int threads) {
  if (device.kind == DeviceKind::cuda) return make_cuda_articulated_machine(device.ordinal, job, env_count);
  if (device.kind == DeviceKind::emulated) return make_emulated_articulated_machine(job, env_count);
  return make_cpu_articulated_machine<Real>(threads);
}

VariedSet set_of(const std::vector<VariedArray>& arrays) {
  VariedSet set = 0;
  for (const VariedArray one : arrays) set |= bit_of(one);
  return set;
}

}  // namespace

template <class Real>
struct ArticulatedBatch<Real>::Parts {
  Parts(Device device, const ArticulatedDescription& description, Offset envs, const ArticulatedOptions& how)
      : options(how),
        env_count(envs),
        model(description, set_of(how.varies)),
        view(model.view()),
        status(at(envs)),
        touched(at(envs)) {
    for (Offset env = 0; env < envs; ++env) qpos.insert(qpos.end(), model.qpos0().begin(), model.qpos0().end());
    for (auto* array : {&qvel, &qacc, &applied}) array->resize(at(envs * view.dof_count));
    time.resize(at(envs));
    timestep = description.timestep;
    ctrl.resize(at(envs * view.actuator_count));
    for (std::size_t k = 0; k < kObservedArrays && how.observes_bodies; ++k) {
      observed[k].resize(at(envs * view.observed_width[k]));
      observed_data[k] = observed[k].data();
    }
    for (const VariedArray one : how.varies) vary(one, description);
    machine = make_machine(device, job(), envs, how.threads);
  }

  /// Gives each environment an array of its own.
  void vary(VariedArray which, const ArticulatedDescription& description) {
    std::vector<Real>& array = varied[static_cast<std::size_t>(which)];
    array.clear();
    const std::vector<double> row = constants_of(description, which);
    for (Offset env = 0; env < env_count; ++env)
      for (const double number : row) array.push_back(static_cast<Real>(number));
    varied_data[static_cast<std::size_t>(which)] = array.data();
  }

  [[nodiscard]] ArticulatedJob<Real> job() {
    return {view,
            qpos.data(),
            qvel.data(),
            qacc.data(),
            time.data(),
            ctrl.data(),
            applied.data(),
            nullptr,
            status.data(),
            touched.data(),
            options.tolerance,
            options.max_iterations,
            nullptr,
            options.observes_bodies ? observed_data.data() : nullptr,
            options.varies.empty() ? nullptr : varied_data.data(),
            false,
            timestep};
  }
  /// Arrays of the host.
  [[nodiscard]] ArticulatedView<Real> all() {
    ArticulatedView<Real> arrays{qpos.data(),   qvel.data(),   ctrl.data(), applied.data(), qacc.data(), time.data(),
                                 status.data(), observed_data, {}};
    for (std::size_t k = 0; k < kVariedArrays; ++k) arrays.varied[k] = varied[k].data();
    return arrays;
  }
  /// Steps, or does what a job says, in all environments or those of a mask.
  void run(ArticulatedJob<Real> job, Index count, std::span<const std::uint8_t> active, StreamRef stream) {
    if (!active.empty()) expect_length("active", active.size(), at(env_count), "one byte per environment");
    if (!active.empty()) job.active = active.data();
    machine->step(job, env_count, count, stream);
  }
  /// An array as steps have left it.
  template <class T>
  std::span<T> open(std::vector<T>& array) {
    machine->fetch(array.data());
    return array;
  }
  void reset(std::span<const std::uint8_t> mask, StreamRef stream) {
    machine->reset(
        {all(), mask.data(), model.qpos0().data(), env_count, view.q_count, view.dof_count, view.actuator_count},
        stream);
  }

  ArticulatedOptions options;
  Offset env_count;
  ArticulatedModel<Real> model;
  ArticulatedModelView<Real> view;
  std::unique_ptr<ArticulatedMachine<Real>> machine;
  std::vector<Real> qpos, qvel, qacc, ctrl, applied;
  std::vector<double> time;
  double timestep;
  std::array<std::vector<Real>, kObservedArrays> observed;
  std::array<Real*, kObservedArrays> observed_data{};
  std::array<std::vector<Real>, kVariedArrays> varied;
  std::array<const Real*, kVariedArrays> varied_data{};
  std::vector<EnvStatus> status;
  std::vector<std::uint64_t> touched;  ///< of the last step: which rows each had
};

template <class Real>
ArticulatedBatch<Real>::ArticulatedBatch(const ArticulatedDescription& description, Offset env_count,
                                         const ArticulatedOptions& options)
    : ArticulatedBatch(Device::cpu(), description, env_count, options) {}
template <class Real>
ArticulatedBatch<Real>::ArticulatedBatch(Device device, const ArticulatedDescription& description, Offset env_count,
                                         const ArticulatedOptions& options) {
  const ScopedFpEnv fp_env;
  check_options<Real>(options);
  check_articulated(description);
  if (env_count < 0) refuse("env_count = " + std::to_string(env_count) + ": must be >= 0");
  parts_ = std::make_unique<Parts>(device, description, env_count, options);
}
template <class Real>
ArticulatedBatch<Real>::~ArticulatedBatch() = default;
template <class Real>
ArticulatedBatch<Real>::ArticulatedBatch(ArticulatedBatch&&) noexcept = default;
template <class Real>
ArticulatedBatch<Real>& ArticulatedBatch<Real>::operator=(ArticulatedBatch&&) noexcept = default;

template <class Real>
void ArticulatedBatch<Real>::step(Index count, std::span<const std::uint8_t> active, StreamRef stream) {
  const ScopedFpEnv fp_env;
  if (count < 0) refuse("count = " + std::to_string(count) + ": must be >= 0");
  parts_->run(parts_->job(), count, active, stream);
}

template <class Real>
void ArticulatedBatch<Real>::forward(std::span<const std::uint8_t> active, StreamRef stream) {
  const ScopedFpEnv fp_env;
  ArticulatedJob<Real> job = parts_->job();
  job.is_still = true;
  parts_->run(job, 1, active, stream);
}

template <class Real>
void ArticulatedBatch<Real>::reset(std::span<const std::uint8_t> mask, StreamRef stream) {
  expect_length("mask", mask.size(), at(parts_->env_count), "one byte per environment");
  parts_->reset(mask, stream);
}

template <class Real>
void ArticulatedBatch<Real>::copy_ctrl(const Real* ctrl, StreamRef stream) {
  std::vector<Real>& to = parts_->ctrl;
  if (!to.empty()) parts_->machine->overwrite(to.data(), ctrl, to.size() * sizeof(Real), stream);
}

template <class Real>
ArticulatedView<Real> ArticulatedBatch<Real>::view() {
  return parts_->machine->view(parts_->all());
}

template <class Real>
void ArticulatedBatch<Real>::synchronize() const {
  parts_->machine->synchronize();
}

template <class Real>
ArticulatedProbe ArticulatedBatch<Real>::probe() {
  const ScopedFpEnv fp_env;
  const ArticulatedModelView<Real>& model = parts_->view;
  ArticulatedProbe found;
  found.most_rows = model.most_rows;
  found.most_contacts = model.points;
  ArticulatedProbeView view{};
  view.most_rows = found.most_rows;
  view.most_contacts = found.most_contacts;
  const auto make = [](Offset elements, auto& array, auto*& data) {
    array.resize(at(elements));
    data = array.data();
  };
  for_each_probe_array(model, parts_->env_count, make, found, view);
  std::vector<EnvStatus> unused(at(parts_->env_count));
  ArticulatedJob<Real> job = parts_->job();
  job.status = unused.data();
  job.touched = nullptr;
  job.probe = &view;
  job.observed = nullptr;
  job.is_still = true;
  parts_->run(job, 1, {}, StreamRef::default_stream());
  return found;
}

template <class Real>
std::span<Real> ArticulatedBatch<Real>::qpos() {
  return parts_->open(parts_->qpos);
}
template <class Real>
std::span<Real> ArticulatedBatch<Real>::qvel() {
  return parts_->open(parts_->qvel);
}
template <class Real>
std::span<Real> ArticulatedBatch<Real>::ctrl() {
  return parts_->open(parts_->ctrl);
}
template <class Real>
std::span<Real> ArticulatedBatch<Real>::qfrc_applied() {
  return parts_->open(parts_->applied);
}
template <class Real>
std::span<Real> ArticulatedBatch<Real>::qacc() {
  return parts_->open(parts_->qacc);
}
template <class Real>
std::span<double> ArticulatedBatch<Real>::time() {
  return parts_->open(parts_->time);
}
template <class Real>
std::span<Real> ArticulatedBatch<Real>::observed(ObservedArray array) {
  return parts_->open(parts_->observed[static_cast<std::size_t>(array)]);
}
template <class Real>
Index ArticulatedBatch<Real>::observed_width(ObservedArray array) const {
  return parts_->view.observed_width[static_cast<std::size_t>(array)];
}
template <class Real>
std::span<Real> ArticulatedBatch<Real>::varied(VariedArray array) {
  return parts_->open(parts_->varied[static_cast<std::size_t>(array)]);
}
template <class Real>
Index ArticulatedBatch<Real>::varied_width(VariedArray array) const {
  return parts_->view.varied_width[static_cast<std::size_t>(array)];
}
template <class Real>
std::span<const EnvStatus> ArticulatedBatch<Real>::status() const {
  return parts_->open(parts_->status);
}

template <class Real>
std::uint64_t ArticulatedBatch<Real>::hash() const {
  const std::span<const Real> q = parts_->open(parts_->qpos), v = parts_->open(parts_->qvel);
  std::vector<Real> all(q.begin(), q.end());
  all.insert(all.end(), v.begin(), v.end());
  return hash_bits(std::span<const Real>(all));
}

template <class Real>
Offset ArticulatedBatch<Real>::env_count() const {
  return parts_->env_count;
}
template <class Real>
Index ArticulatedBatch<Real>::q_count() const {
  return parts_->view.q_count;
}
template <class Real>
Index ArticulatedBatch<Real>::dof_count() const {
  return parts_->view.dof_count;
}
template <class Real>
Index ArticulatedBatch<Real>::actuator_count() const {
  return parts_->view.actuator_count;
}

template class ArticulatedBatch<float>;
template class ArticulatedBatch<double>;

}  // namespace stiction
