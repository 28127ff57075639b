#include "core/machine/world_machine.hpp"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <utility>
#include <vector>

#include "core/base/extents.hpp"
#include "core/base/runs.hpp"
#include "cpu_fallback/tables/isa.hpp"
#include "cpu_fallback/threads/thread_pool.hpp"

namespace stiction {

namespace {

/// Environments that one thread takes at a time.
constexpr Offset kRun = 16;

template <class Real>
class CpuWorldMachine final : public WorldMachine<Real> {
 public:
  CpuWorldMachine(const WorldModelView<Real>& model, Offset env_count, const WorldOptions& options)
      : env_count_(env_count),
        threads_(cpu::thread_count(options.solver.threads)),
        keep_(static_cast<Real>(options.warm_start)),
        kernels_(cpu::of_precision<Real>(cpu::best_isa().world_kernels())),
        arrays_(model, env_count),
        last_(arrays_.contacts),
        memory_(at(threads_)),
        found_(at((env_count + kRun - 1) / kRun)),
        begin_(at(env_count)) {
    for (Memory& memory : memory_) memory.workspace.reserve(kernels_.workspace_bytes(model));
  }

  WorldSolve<Real> find_contacts() override {
    HostContacts<Real>& now = arrays_.contacts;
    const WorldJob<Real> job = arrays_.job();
    std::swap(now, last_);
    now.offsets[0] = 0;
    for_each_run_of_environments([&](int run, int worker, Offset begin, Offset end) {
      std::vector<FoundContact<Real>>& found = found_[at(run)];
      Memory& memory = memory_[at(worker)];
      void* const workspace = memory.workspace.data();
      found.clear();
      for (Offset env = begin; env < end; ++env) {
        const Index near = make_room_for_near_pairs(job, env, memory);
        const Index count = kernels_.find_contacts(job, env, workspace, near, memory.pairs.data());
        begin_[at(env)] = found.size();
        now.offsets[at(env) + 1] = count;
        found.resize(found.size() + at(count));
        kernels_.list_contacts(job, env, workspace, near, memory.pairs.data(), found.data() + begin_[at(env)]);
      }
    });
    std::partial_sum(now.offsets.begin(), now.offsets.end(), now.offsets.begin());
    now.resize(now.offsets.back());
    ContactSink<Real> sink{now.view(), last_.view(), keep_};
    if (!(keep_ > 0)) sink.last.offsets = nullptr;
    for_each_run_of_environments([&](int run, int, Offset begin, Offset end) {
      for (Offset env = begin; env < end; ++env)
        kernels_.emit_contacts(job, sink, env, found_[at(run)].data() + begin_[at(env)]);
    });
    const BodyBatchView<Real> batch = arrays_.batch();
    return {batch,
            batch,
            {now.impulse.data(), arrays_.solved_twist.data(), nullptr, arrays_.status.data()},
            keep_ > 0 ? now.guess.data() : nullptr,
            StreamRef::default_stream()};
  }
  void await_solve() override {}
  void integrate() override {
    const WorldJob<Real> job = arrays_.job();
    for_each_run_of_environments([&](int, int, Offset begin, Offset end) {
      for (Offset env = begin; env < end; ++env) kernels_.integrate(job, env);
    });
  }

  WorldArrays<Real>& observe(WorldPart) override { return arrays_; }
  void restart(std::span<const std::uint8_t> mask) override {
    HostContacts<Real>& now = arrays_.contacts;
    for_each_run(mask, [&](std::size_t begin, std::size_t end) {
      std::fill(now.impulse.begin() + 3 * now.offsets[begin], now.impulse.begin() + 3 * now.offsets[end], Real(0));
    });
  }
  void resume(const WorldCheckpoint<Real>& from) override { arrays_.resume(from); }
  std::span<Real> wrench() override { return arrays_.wrench; }
  void motion(std::span<WorldMotion> out) override {
    const WorldJob<Real> job = arrays_.job();
    for_each_run_of_environments([&](int, int, Offset begin, Offset end) {
      for (Offset env = begin; env < end; ++env) out[at(env)] = kernels_.motion(job, env);
    });
  }

 private:
  /// Uninitialised, and aligned for everything.
  class Scratch {
   public:
    void reserve(Offset bytes) {
      const std::size_t words = (at(bytes) + sizeof(std::max_align_t) - 1) / sizeof(std::max_align_t);
      if (words <= words_) return;
      memory_.reset();
      words_ = 0;
      memory_ = std::make_unique_for_overwrite<std::max_align_t[]>(words);
      words_ = words;
    }
    [[nodiscard]] void* data() const { return memory_.get(); }

   private:
    std::unique_ptr<std::max_align_t[]> memory_;
    std::size_t words_ = 0;
  };
  struct Memory {
    Scratch workspace, pairs;
  };

  /// Counts the near pairs of an environment that has a tree, and makes room for them.
  Index make_room_for_near_pairs(const WorldJob<Real>& job, Offset env, Memory& memory) {
    if (!job.model.by_tree) return 0;
    const Offset near = kernels_.count_near(job, env, memory.workspace.data());
    check_near_pairs(near, env);
    memory.pairs.reserve(kernels_.pair_bytes(near));
    return static_cast<Index>(near);
  }

  template <class F>
  void for_each_run_of_environments(F&& work) {
    cpu::parallel_for(threads_, static_cast<int>(found_.size()), [&](int run, int worker) {
      work(run, worker, run * kRun, smaller_of(env_count_, (run + 1) * kRun));
    });
  }

  Offset env_count_;
  int threads_;
  Real keep_;
  cpu::WorldKernels<Real> kernels_;
  WorldArrays<Real> arrays_;
  HostContacts<Real> last_;                             ///< contacts of the step before
  std::vector<Memory> memory_;                          ///< scratch of each worker
  std::vector<std::vector<FoundContact<Real>>> found_;  ///< of each run of environments
  std::vector<std::size_t> begin_;                      ///< of each environment in its run's
};

}  // namespace

template <class Real>
std::unique_ptr<WorldMachine<Real>> make_cpu_world_machine(const WorldModelView<Real>& model, Offset env_count,
                                                           const WorldOptions& options) {
  return std::make_unique<CpuWorldMachine<Real>>(model, env_count, options);
}

template std::unique_ptr<WorldMachine<float>> make_cpu_world_machine(const WorldModelView<float>&, Offset,
                                                                     const WorldOptions&);
template std::unique_ptr<WorldMachine<double>> make_cpu_world_machine(const WorldModelView<double>&, Offset,
                                                                      const WorldOptions&);

}  // namespace stiction
