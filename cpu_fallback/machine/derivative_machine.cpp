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

/// Environments that one thread takes at a time: less would cost more than it shares.
constexpr Offset kRun = 8;

/// kernel(job, env, scratch) for every environment. Scratch is there before the first output is written.
template <class Job, class Elements, class Number>
void for_each_env(const Job& job, int threads, const Elements& elements, void (*kernel)(const Job&, Offset, Number*)) {
  const Offset envs = job.batch.env_count, runs = (envs + kRun - 1) / kRun;
  Offset largest = 0;
  for (Offset env = 0; env < envs; ++env) largest = larger_of(largest, elements(job, env));
  const int workers = static_cast<int>(smaller_of<Offset>(cpu::thread_count(threads), larger_of<Offset>(runs, 1)));
  std::vector<cpu::GrowBuffer> scratch(static_cast<std::size_t>(workers));
  std::vector<Number*> memory;
  memory.reserve(scratch.size());
  for (cpu::GrowBuffer& buffer : scratch) memory.push_back(buffer.template reserve<Number>(largest));
  cpu::parallel_for(workers, static_cast<int>(runs), [&](int run, int worker) {
    const Offset end = smaller_of(envs, (run + 1) * kRun);
    for (Offset env = run * kRun; env < end; ++env) kernel(job, env, memory[static_cast<std::size_t>(worker)]);
  });
}

class CpuDerivativeMachine final : public DerivativeMachine {
 public:
  explicit CpuDerivativeMachine(int threads) : threads_(threads) {}

  void vjp(const VjpJob<float>& job, StreamRef) override { pull_back(job); }
  void vjp(const VjpJob<double>& job, StreamRef) override { pull_back(job); }
  void jvp(const JvpJob<float>& job, StreamRef) override { push_forward(job); }
  void jvp(const JvpJob<double>& job, StreamRef) override { push_forward(job); }
  void synchronize(StreamRef) override {}

 private:
  template <class Real>
  void pull_back(const VjpJob<Real>& job) const {
    const cpu::DerivativeKernels<Real> kernels = pick<Real>();
    for_each_env(job, threads_, kernels.elements, kernels.vjp);
  }
  template <class Real>
  void push_forward(const JvpJob<Real>& job) const {
    const cpu::DerivativeKernels<Real> kernels = pick<Real>();
    for_each_env(job, threads_, kernels.elements, kernels.jvp);
  }

  int threads_;
};

}  // namespace

std::unique_ptr<DerivativeMachine> make_cpu_derivative_machine(int threads) {
  return std::make_unique<CpuDerivativeMachine>(threads);
}

template <class Real>
void seed_on_cpu(const JacobianVjpJob<Real>& job, int threads) {
  const cpu::DerivativeKernels<Real> kernels = pick<Real>();
  for_each_env(job, threads, kernels.chain_elements, kernels.seed);
}
template <class Real>
void chain_on_cpu(const JacobianVjpJob<Real>& job, int threads) {
  const cpu::DerivativeKernels<Real> kernels = pick<Real>();
  for_each_env(job, threads, kernels.chain_elements, kernels.chain);
}

template void seed_on_cpu(const JacobianVjpJob<float>&, int);
template void seed_on_cpu(const JacobianVjpJob<double>&, int);
template void chain_on_cpu(const JacobianVjpJob<float>&, int);
template void chain_on_cpu(const JacobianVjpJob<double>&, int);

}  // namespace stiction
