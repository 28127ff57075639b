#include "core/runtime/world_machine.hpp"

#include <cstddef>
#include <type_traits>
#include <vector>

#include "core/base/extents.hpp"
#include "cpu_fallback/isa.hpp"
#include "cpu_fallback/thread_pool.hpp"

namespace stiction {

namespace {

/// Environments that one thread takes at a time.
constexpr Offset kRun = 16;

template <class Real>
const cpu::WorldKernels<Real>& pick(const cpu::WorldKernelSet& set) {
  if constexpr (std::is_same_v<Real, float>) {
    return set.f32;
  } else {
    return set.f64;
  }
}

template <class Real>
class CpuWorld final : public WorldMachine<Real> {
 public:
  CpuWorld(Offset env_count, int threads)
      : env_count_(env_count),
        threads_(cpu::thread_count(threads)),
        kernels_(pick<Real>(cpu::best_isa().world_kernels())),
        room_(at(threads_)),
        found_(at((env_count + kRun - 1) / kRun)),
        begin_(at(env_count)) {}

  void find_contacts(const WorldJob<Real>& job, std::span<Offset> counts) override {
    const std::size_t words =
        (kernels_.room_bytes(job.model) + sizeof(std::max_align_t) - 1) / sizeof(std::max_align_t);
    for (auto& room : room_) room.resize(words);
    for_each_run([&](int run, int worker, Offset begin, Offset end) {
      std::vector<FoundContact<Real>>& found = found_[at(run)];
      void* const room = room_[at(worker)].data();
      found.clear();
      for (Offset env = begin; env < end; ++env) {
        const Index count = kernels_.find_contacts(job, env, room);
        begin_[at(env)] = found.size();
        counts[at(env)] = count;
        found.resize(found.size() + at(count));
        kernels_.list_contacts(job, env, room, found.data() + begin_[at(env)]);
      }
    });
  }
  void hand_over(const WorldJob<Real>& job, const ContactSink<Real>& sink) override {
    for_each_run([&](int run, int, Offset begin, Offset end) {
      for (Offset env = begin; env < end; ++env)
        kernels_.hand_over(job, sink, env, found_[at(run)].data() + begin_[at(env)]);
    });
  }
  void integrate(const WorldJob<Real>& job) override {
    for_each_run([&](int, int, Offset begin, Offset end) {
      for (Offset env = begin; env < end; ++env) kernels_.integrate(job, env);
    });
  }
  void motion(const WorldJob<Real>& job, std::span<WorldMotion> out) override {
    for_each_run([&](int, int, Offset begin, Offset end) {
      for (Offset env = begin; env < end; ++env) out[at(env)] = kernels_.motion(job, env);
    });
  }

 private:
  template <class F>
  void for_each_run(F&& work) {
    cpu::parallel_for(threads_, static_cast<int>(found_.size()), [&](int run, int worker) {
      work(run, worker, run * kRun, smaller_of(env_count_, (run + 1) * kRun));
    });
  }

  Offset env_count_;
  int threads_;
  cpu::WorldKernels<Real> kernels_;
  std::vector<std::vector<std::max_align_t>> room_;     ///< scratch of each worker
  std::vector<std::vector<FoundContact<Real>>> found_;  ///< of each run of environments
  std::vector<std::size_t> begin_;                      ///< of each environment in its run's
};

}  // namespace

template <class Real>
std::unique_ptr<WorldMachine<Real>> make_cpu_world(Offset env_count, int threads) {
  return std::make_unique<CpuWorld<Real>>(env_count, threads);
}

template std::unique_ptr<WorldMachine<float>> make_cpu_world(Offset, int);
template std::unique_ptr<WorldMachine<double>> make_cpu_world(Offset, int);

}  // namespace stiction
