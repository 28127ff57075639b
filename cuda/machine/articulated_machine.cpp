#include "cuda/machine/articulated_machine.hpp"

#include <array>
#include <string>
#include <utility>

#include "core/base/extents.hpp"
#include "cuda/api/memory.hpp"
#include "cuda/api/mover.hpp"
#include "cuda/api/robot_kernels.hpp"
#include "cuda/kernels/robots_program.hpp"
#include "cuda/machine/memory_limits.hpp"
#include "cuda/machine/resident_arrays.hpp"
#include "stiction/error.hpp"

namespace stiction::cuda {

namespace {

template <class Real>
class DeviceArticulatedMachine final : public ArticulatedMachine<Real> {
 public:
  DeviceArticulatedMachine(std::shared_ptr<DeviceApi> api, const ArticulatedJob<Real>& job, Offset env_count,
                           Offset most_bytes)
      : api_(std::move(api)),
        kernel_(api_->robot_kernels().step[kPrecision]),
        reset_(api_->robot_kernels().reset[kPrecision]),
        done_(*api_),
        arrays_(*api_) {
    build_robot_tree(job.model, tree_);
    args_.job = job;
    args_.env_count = env_count;
    find_room(most_bytes);
    place_arrays(job);
    list_arrays(job);
    api_->prepare(kernel_, shape_);
    api_->prepare(reset_, reset_shape());
    queue_all(*api_, stream_, [&] {
      copy_model(job.model);
      arrays_.queue_all_to_device(stream_);
      api_->synchronize(stream_);
    });
  }
  ~DeviceArticulatedMachine() override {
    try {
      api_->synchronize(stream_);
    } catch (const Error&) {
      return;  // the device is lost, and nothing runs on it
    }
  }

  void step(const ArticulatedJob<Real>& job, Offset, Index count, StreamRef stream) override {
    if (args_.env_count == 0 || count == 0) return;
    const bool is_captured = api_->capturing(stream.handle());
    if (is_captured) {
      if (arrays_.has_changes() || job.active != nullptr || job.probe != nullptr)
        throw Error(ErrorCode::invalid_argument,
                    "stream is being captured: give no mask, and call view() before, which "
                    "takes changed spans over");
      arrays_.share();
    } else {
      follow(stream);
      arrays_.give_back(stream_);
    }
    RobotsArgs<Real> args = args_;
    args.steps = count;
    args.job.tolerance = job.tolerance;
    args.job.max_iterations = job.max_iterations;
    args.job.is_still = job.is_still;
    if (job.active == nullptr) args.job.active = nullptr;
    if (job.observed == nullptr) args.job.observed = nullptr;
    ArticulatedProbeView probe;
    const DeviceMemory probed = make_probe(job, probe, args.job);
    if (job.probe == nullptr) arrays_.note_work();
    queue_all(*api_, stream.handle(), [&] {
      Mover mover(*api_, stream.handle());
      mover.to_device(args.job.active, job.active, args_.env_count);
      if (job.active != nullptr) api_->synchronize(stream.handle());  // the mask is the caller's
      if (job.probe != nullptr) {
        api_->fill_zero(probed.get(), probed.bytes(), stream.handle());
        mover.to_device(args.job.probe, &probe, 1);
      }
      api_->launch(kernel_, shape_, &args, stream.handle());
      if (job.probe != nullptr) fetch_probe(job, probe);
      if (!is_captured) api_->record(done_.get(), stream.handle());
    });
  }

  void fetch(const void* array) override { arrays_.open(array, stream_); }
  void reset(const ArticulatedResetJob<Real>& job, StreamRef stream) override {
    if (args_.env_count == 0) return;
    follow(stream);
    arrays_.give_back(stream_);
    for_each_reset_array(job.to, [&](const auto* array) { arrays_.leave(array); });
    ArticulatedResetJob<Real> there = job;
    there.to = on_device();
    there.mask = args_.job.active;
    there.first = first_;
    queue_all(*api_, stream_, [&] {
      Mover mover(*api_, stream_);
      mover.to_device(there.mask, job.mask, args_.env_count);
      mover.to_device(there.first, job.first, job.q_count);
      api_->launch(reset_, reset_shape(), &there, stream_);
      api_->record(done_.get(), stream_);
      api_->synchronize(stream_);  // the mask is the caller's
    });
  }
  void overwrite(void* array, const void* from, std::size_t bytes, StreamRef stream) override {
    follow(stream);
    arrays_.give_back(stream_);
    arrays_.overwrite(array, from, bytes, stream_);
    api_->record(done_.get(), stream_);
  }
  ArticulatedView<Real> view(const ArticulatedView<Real>&) override {
    arrays_.give_back(stream_);
    arrays_.share();
    return on_device();
  }
  void synchronize() override { api_->synchronize(stream_); }

 private:
  static constexpr std::size_t kPrecision = sizeof(Real) == sizeof(float) ? 0 : 1;

  [[nodiscard]] LaunchShape reset_shape() const { return {args_.env_count, kWarp}; }
  [[nodiscard]] ArticulatedView<Real> on_device() const {
    const ArticulatedJob<Real>& job = args_.job;
    ArticulatedView<Real> there{job.qpos,
                                job.qvel,
                                const_cast<Real*>(job.ctrl),
                                const_cast<Real*>(job.qfrc_applied),
                                job.qacc,
                                job.time,
                                job.status,
                                observed_,
                                {}};
    for (std::size_t k = 0; k < kVariedArrays; ++k) there.varied[k] = const_cast<Real*>(varied_[k]);
    return there;
  }

  /// Teams as many as there is work, memory and room on the device for.
  void find_room(Offset most_bytes) {
    StepRobots<Real>::lay_out(tree_, args_);
    const Offset team_bytes = static_cast<Offset>(sizeof(double)) * args_.numbers_per_team +
                              static_cast<Offset>(sizeof(Offset)) * kWarp * args_.lists_per_lane;
    const Offset wanted = (args_.env_count + kWarp - 1) / kWarp,
                 fitting = larger_of<Offset>(1, most_bytes / team_bytes);
    shape_.teams = smaller_of(wanted, smaller_of(fitting, kTeamsPerProcessor * api_->facts().processors));
    shape_.lanes = kWarp;
  }

  /// One block of memory for everything. Arrays that `job` does not name have no room.
  void place_arrays(const ArticulatedJob<Real>& job) {
    const ArticulatedModelView<Real>& model = job.model;
    const Offset envs = args_.env_count;
    ArraySet set;
    const auto add = [&](Offset width, auto*& array) { set.add(array, envs * width); };
    for_each_model_array(model, [&](Offset elements, auto*& array) { set.add(array, elements); }, args_.job.model);
    for_each_input_array(model, add, args_.job);
    for_each_state_array(model, add, args_.job);
    for (std::size_t k = 0; k < kObservedArrays && job.observed != nullptr; ++k)
      add(model.observed_width[k], observed_[k]);
    for (std::size_t k = 0; k < kVariedArrays && job.varied != nullptr; ++k)
      if (job.varied[k] != nullptr) add(model.varied_width[k], varied_[k]);
    set.add(args_.job.observed, job.observed != nullptr ? Offset{kObservedArrays} : 0);
    set.add(args_.job.varied, job.varied != nullptr ? Offset{kVariedArrays} : 0);
    set.add(args_.job.active, envs);
    set.add(first_, model.q_count);
    set.add(args_.tree, 1);
    set.add(args_.numbers, shape_.teams * args_.numbers_per_team);
    set.add(args_.lists, shape_.teams * kWarp * args_.lists_per_lane);
    memory_ = DeviceMemory(*api_, set.bytes());
    set.place(memory_.get());
    args_.job.touched = nullptr;
    if (job.observed == nullptr) args_.job.observed = nullptr;
    if (job.varied == nullptr) args_.job.varied = nullptr;
  }

  /// Everything that no step changes.
  void copy_model(const ArticulatedModelView<Real>& model) {
    Mover mover(*api_, stream_);
    for_each_model_array(
        model, [&](Offset elements, auto* there, auto* here) { mover.to_device(there, here, elements); },
        args_.job.model, model);
    mover.to_device(args_.job.observed, observed_.data(), kObservedArrays);
    mover.to_device(args_.job.varied, varied_.data(), kVariedArrays);
    mover.to_device(args_.tree, &tree_, 1);
  }

  /// Names the host's arrays beside the device's.
  void list_arrays(const ArticulatedJob<Real>& job) {
    const Offset envs = args_.env_count;
    constexpr const char* kInputs[] = {"ctrl", "qfrc_applied"};
    constexpr const char* kStates[] = {"qpos", "qvel", "qacc", "time", "status"};
    const char* const* name = kInputs;
    const auto add_input = [&](Offset width, auto* there, auto* here) {
      arrays_.add(*name++, here, there, envs * width, false);
    };
    for_each_input_array(job.model, add_input, args_.job, job);
    name = kStates;
    const auto add_state = [&](Offset width, auto* there, auto* here) {
      arrays_.add(*name++, here, there, envs * width, true);
    };
    for_each_state_array(job.model, add_state, args_.job, job);
    for (std::size_t k = 0; k < kObservedArrays && job.observed != nullptr; ++k)
      arrays_.add("observed " + std::to_string(k), job.observed[k], observed_[k], envs * job.model.observed_width[k],
                  true);
    for (std::size_t k = 0; k < kVariedArrays && job.varied != nullptr; ++k)
      arrays_.add("varied " + std::to_string(k), job.varied[k], varied_[k], envs * job.model.varied_width[k], false);
  }

  /// Puts work that is queued on this stream from now on after all that was queued before.
  void follow(StreamRef stream) {
    if (stream.handle() == stream_) return;
    api_->wait(stream.handle(), done_.get());
    stream_ = stream.handle();
  }

  /// Memory for what a job is probed for: the view itself, its arrays, and records that nothing reads.
  DeviceMemory make_probe(const ArticulatedJob<Real>& job, ArticulatedProbeView& there, ArticulatedJob<Real>& asked) {
    if (job.probe == nullptr) return {};
    there = *job.probe;
    ArraySet set;
    set.add(asked.probe, 1);
    set.add(asked.status, args_.env_count);
    for_each_probe_array(
        job.model, args_.env_count, [&](Offset elements, auto*& array) { set.add(array, elements); }, there);
    DeviceMemory memory(*api_, set.bytes());
    set.place(memory.get());
    return memory;
  }
  void fetch_probe(const ArticulatedJob<Real>& job, const ArticulatedProbeView& probe) {
    Mover mover(*api_, stream_);
    for_each_probe_array(
        job.model, args_.env_count,
        [&](Offset elements, auto* there, auto* here) { mover.to_host(here, there, elements); }, probe, *job.probe);
    api_->synchronize(stream_);
  }

  std::shared_ptr<DeviceApi> api_;
  KernelRef kernel_, reset_;
  StreamHandle stream_ = nullptr;  ///< of the last steps
  Event done_;                     ///< after the last of them
  ResidentArrays arrays_;
  RobotTree tree_;
  RobotsArgs<Real> args_{};  ///< with pointers to the device's memory
  LaunchShape shape_;
  const Real* first_ = nullptr;                      ///< coordinates that a reset gives
  std::array<Real*, kObservedArrays> observed_{};    ///< on the device, as args_.job.observed has them
  std::array<const Real*, kVariedArrays> varied_{};  ///< likewise
  DeviceMemory memory_;
};

}  // namespace

template <class Real>
std::unique_ptr<ArticulatedMachine<Real>> make_device_articulated_machine(std::shared_ptr<DeviceApi> api,
                                                                          const ArticulatedJob<Real>& job,
                                                                          Offset env_count, Offset most_bytes) {
  return std::make_unique<DeviceArticulatedMachine<Real>>(std::move(api), job, env_count, most_bytes);
}

template std::unique_ptr<ArticulatedMachine<float>> make_device_articulated_machine(std::shared_ptr<DeviceApi>,
                                                                                    const ArticulatedJob<float>&,
                                                                                    Offset, Offset);
template std::unique_ptr<ArticulatedMachine<double>> make_device_articulated_machine(std::shared_ptr<DeviceApi>,
                                                                                     const ArticulatedJob<double>&,
                                                                                     Offset, Offset);

}  // namespace stiction::cuda
