#include <algorithm>
#include <vector>

#include "core/algorithm/warm_start/warm_start.hpp"
#include "core/base/extents.hpp"
#include "core/machine/warm_start_machine.hpp"
#include "cpu_fallback/threads/thread_pool.hpp"

namespace stiction {

namespace {

template <class Real>
class CpuWarmStartMachine final : public WarmStartMachine<Real> {
 public:
  CpuWarmStartMachine(const WarmStartCapacity& capacity, int threads)
      : threads_(cpu::thread_count(threads)),
        slot_(static_cast<std::size_t>(capacity.envs)),
        record_(slot_.size()),
        stored_(static_cast<std::size_t>(capacity.cones)),
        sorting_(stored_.size()),
        lambda_(static_cast<std::size_t>(capacity.rows)),
        memory_{capacity.envs,  capacity.cones, capacity.rows,   slot_.data(),
                record_.data(), stored_.data(), sorting_.data(), lambda_.data()} {}

  void load(const WarmStartLoadJob<Real>& request, StreamRef) override {
    WarmStartLoadJob<Real> job = request;
    job.memory = memory_;
    for_each_env(job.batch.env_count, [&](SerialTeam& team, Offset env) { load_warm_start(team, job, env); });
  }
  void store(const WarmStartStoreJob<Real>& request, StreamRef) override {
    WarmStartStoreJob<Real> job = request;
    job.memory = memory_;
    for_each_env(memory_.env_capacity, [&](SerialTeam& team, Offset env) { store_warm_start(team, job, env); });
  }
  void reset(std::span<const Offset> envs, StreamRef) override {
    SerialTeam team;
    for (const Offset env : envs) reset_warm_start(team, memory_, env, kWarmStartReset);
  }
  void reset_where(const std::uint8_t* mask, StreamRef) override {
    SerialTeam team;
    for (Offset env = 0; env < memory_.env_capacity; ++env)
      reset_masked(team, WarmStartResetJob<Real>{memory_, mask}, env);
  }
  void records(std::span<WarmStartRecord> out, StreamRef) override {
    std::copy_n(record_.begin(), out.size(), out.begin());
  }

 private:
  /// Environments that one thread takes at a time: less would cost more than it shares.
  static constexpr Offset kRun = 64;

  template <class F>
  void for_each_env(Offset count, F&& work) {
    const Offset runs = (count + kRun - 1) / kRun;
    cpu::parallel_for(threads_, static_cast<int>(runs), [&](int run, int) {
      SerialTeam team;
      const Offset end = smaller_of(count, (run + 1) * kRun);
      for (Offset env = run * kRun; env < end; ++env) work(team, env);
    });
  }

  int threads_;
  std::vector<WarmStartSlot> slot_;
  std::vector<WarmStartRecord> record_;
  std::vector<WarmStartEntry> stored_, sorting_;
  std::vector<Real> lambda_;
  WarmStartMemory<Real> memory_;
};

}  // namespace

template <class Real>
std::unique_ptr<WarmStartMachine<Real>> make_cpu_warm_start_machine(const WarmStartCapacity& capacity, int threads) {
  return std::make_unique<CpuWarmStartMachine<Real>>(capacity, threads);
}

template std::unique_ptr<WarmStartMachine<float>> make_cpu_warm_start_machine(const WarmStartCapacity&, int);
template std::unique_ptr<WarmStartMachine<double>> make_cpu_warm_start_machine(const WarmStartCapacity&, int);

}  // namespace stiction
