#include "core/machine/derivative_machine.hpp"

#include <type_traits>
#include <vector>

#include "core/base/extents.hpp"
#include "cpu_fallback/kernels/isa.hpp"
#include "cpu_fallback/kernels/scratch.hpp"
#include "cpu_fallback/threads/thread_pool.hpp"

namespace stiction {

namespace {

template <class Real>
cpu::DerivativeKernels<Real> pick() {
  const cpu::DerivativeKernelSet set = cpu::best_isa().derivative();
  if constexpr (std::is_same_v<Real, float>) {
    return set.f32;
  } else {
    return set.f64;
  }
}

class CpuDerivativeMachine final : public DerivativeMachine {
 public:
  explicit CpuDerivativeMachine(int threads) : threads_(threads) {}

  void vjp(const VjpJob<float>& job) override { run(job, pick<float>().elements, pick<float>().vjp); }
  void vjp(const VjpJob<double>& job) override { run(job, pick<double>().elements, pick<double>().vjp); }
  void jvp(const JvpJob<float>& job) override { run(job, pick<float>().elements, pick<float>().jvp); }
  void jvp(const JvpJob<double>& job) override { run(job, pick<double>().elements, pick<double>().jvp); }
  void seed(const JacobianVjpJob<float>& job) override { run(job, pick<float>().chain_elements, pick<float>().seed); }
  void seed(const JacobianVjpJob<double>& job) override {
    run(job, pick<double>().chain_elements, pick<double>().seed);
  }
  void chain(const JacobianVjpJob<float>& job) override { run(job, pick<float>().chain_elements, pick<float>().chain); }
  void chain(const JacobianVjpJob<double>& job) override {
    run(job, pick<double>().chain_elements, pick<double>().chain);
  }

 private:
  /// Environments that one thread takes at a time: less would cost more than it shares.
  static constexpr Offset kRun = 8;

  /// kernel(job, env, scratch) for every environment. Scratch is there before the first output is written.
  template <class Job, class Elements, class Number>
  void run(const Job& job, const Elements& elements, void (*kernel)(const Job&, Offset, Number*)) const {
    const Offset envs = job.batch.env_count, runs = (envs + kRun - 1) / kRun;
    Offset largest = 0;
    for (Offset env = 0; env < envs; ++env) largest = larger_of(largest, elements(job, env));
    const int workers = static_cast<int>(smaller_of<Offset>(cpu::thread_count(threads_), larger_of<Offset>(runs, 1)));
    std::vector<cpu::GrowBuffer> scratch(static_cast<std::size_t>(workers));
    std::vector<Number*> memory;
    for (cpu::GrowBuffer& buffer : scratch) memory.push_back(buffer.template reserve<Number>(largest));
    cpu::parallel_for(workers, static_cast<int>(runs), [&](int run, int worker) {
      const Offset end = smaller_of(envs, (run + 1) * kRun);
      for (Offset env = run * kRun; env < end; ++env) kernel(job, env, memory[static_cast<std::size_t>(worker)]);
    });
  }

  int threads_;
};

}  // namespace

std::unique_ptr<DerivativeMachine> make_cpu_derivative_machine(int threads) {
  return std::make_unique<CpuDerivativeMachine>(threads);
}

}  // namespace stiction
