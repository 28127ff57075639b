#include "cuda/machine/articulated_machine.hpp"

#include <array>
#include <utility>

#include "core/base/extents.hpp"
#include "cuda/api/memory.hpp"
#include "cuda/api/mover.hpp"
#include "cuda/kernels/robots_program.hpp"
#include "cuda/machine/memory_limits.hpp"

namespace stiction::cuda {

namespace {

template <class Real>
class DeviceArticulatedMachine final : public ArticulatedMachine<Real> {
 public:
  DeviceArticulatedMachine(std::shared_ptr<DeviceApi> api, const ArticulatedJob<Real>& job, Offset env_count,
                           Offset most_bytes)
      : api_(std::move(api)),
        kernel_(api_->robot_kernels().step[sizeof(Real) == sizeof(float) ? 0 : 1]),
        stream_(*api_) {
    build_robot_tree(job.model, tree_);
    args_.job = job;
    args_.env_count = env_count;
    find_room(most_bytes);
    place_arrays(job);
    api_->prepare(kernel_, shape_);
    queue_all(*api_, stream_.get(), [&] {
      copy_model(job.model);
      api_->synchronize(stream_.get());
    });
  }

  void step(const ArticulatedJob<Real>& job, Offset, Index count) override {
    if (args_.env_count == 0 || count == 0) return;
    RobotsArgs<Real> args = args_;
    args.steps = count;
    args.job.tolerance = job.tolerance;
    args.job.max_iterations = job.max_iterations;
    args.job.is_still = job.is_still;
    if (job.active == nullptr) args.job.active = nullptr;
    if (job.observed == nullptr) args.job.observed = nullptr;
    ArticulatedProbeView probe;
    const DeviceMemory probed = make_probe(job, probe);
    args.job.probe = reinterpret_cast<const ArticulatedProbeView*>(probed.get());
    queue_all(*api_, stream_.get(), [&] {
      copy_in(job);
      if (job.probe != nullptr) {
        api_->fill_zero(probed.get(), probed.bytes(), stream_.get());
        Mover(*api_, stream_.get()).to_device(args.job.probe, &probe, 1);
      }
      api_->launch(kernel_, shape_, &args, stream_.get());
      copy_out(job, probe);
      api_->synchronize(stream_.get());
    });
  }

 private:
  /// Teams as many as there is work, memory and room on the device for.
  void find_room(Offset most_bytes) {
    static_cast<LaneRoom&>(args_) = StepRobots<Real>::lay_out(args_.job, tree_);
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
    Mover mover(*api_, stream_.get());
    for_each_model_array(
        model, [&](Offset elements, auto* there, auto* here) { mover.to_device(there, here, elements); },
        args_.job.model, model);
    mover.to_device(args_.job.observed, observed_.data(), kObservedArrays);
    mover.to_device(args_.job.varied, varied_.data(), kVariedArrays);
    mover.to_device(args_.tree, &tree_, 1);
  }

  void copy_in(const ArticulatedJob<Real>& job) {
    const Offset envs = args_.env_count;
    Mover mover(*api_, stream_.get());
    const auto copy = [&](Offset width, auto* there, auto* here) { mover.to_device(there, here, envs * width); };
    for_each_input_array(job.model, copy, args_.job, job);
    for_each_state_array(job.model, copy, args_.job, job);
    for (std::size_t k = 0; k < kObservedArrays && job.observed != nullptr; ++k)
      copy(job.model.observed_width[k], observed_[k], job.observed[k]);
    for (std::size_t k = 0; k < kVariedArrays && job.varied != nullptr; ++k)
      copy(job.model.varied_width[k], varied_[k], job.varied[k]);
    copy(1, args_.job.active, job.active);
  }
  void copy_out(const ArticulatedJob<Real>& job, const ArticulatedProbeView& probe) {
    const Offset envs = args_.env_count;
    Mover mover(*api_, stream_.get());
    const auto copy = [&](Offset width, auto* there, auto* here) { mover.to_host(here, there, envs * width); };
    for_each_state_array(job.model, copy, args_.job, job);
    for (std::size_t k = 0; k < kObservedArrays && job.observed != nullptr; ++k)
      copy(job.model.observed_width[k], observed_[k], job.observed[k]);
    if (job.probe != nullptr)
      for_each_probe_array(
          job.model, envs, [&](Offset elements, auto* there, auto* here) { mover.to_host(here, there, elements); },
          probe, *job.probe);
  }

  /// Memory for what a job is probed for: the view itself, then its arrays.
  DeviceMemory make_probe(const ArticulatedJob<Real>& job, ArticulatedProbeView& there) {
    if (job.probe == nullptr) return {};
    there = *job.probe;
    ArraySet set;
    ArticulatedProbeView* first = nullptr;
    set.add(first, 1);
    for_each_probe_array(
        job.model, args_.env_count, [&](Offset elements, auto*& array) { set.add(array, elements); }, there);
    DeviceMemory memory(*api_, set.bytes());
    set.place(memory.get());
    return memory;
  }

  std::shared_ptr<DeviceApi> api_;
  KernelRef kernel_;
  Stream stream_;
  RobotTree tree_;
  RobotsArgs<Real> args_{};  ///< with pointers to the device's memory
  LaunchShape shape_;
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
