#include "core/machine/derivative_machine.hpp"

#include <type_traits>
#include <vector>

#include "core/base/extents.hpp"
#include "core/machine/jacobian_machine.hpp"
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

/// The kernel for every environment. Scratch is there before the first output is written.
template <class Job>
void for_each_env(const Job& job, Offset envs, int threads, const cpu::DerivativeKernel<Job>& kernel) {
  const Offset runs = (envs + kRun - 1) / kRun;
  Offset largest = 0;
  for (Offset env = 0; env < envs; ++env) largest = larger_of(largest, kernel.elements(job, env));
  const int workers = static_cast<int>(smaller_of<Offset>(cpu::thread_count(threads), larger_of<Offset>(runs, 1)));
  std::vector<cpu::GrowBuffer> scratch(static_cast<std::size_t>(workers));
  std::vector<double*> memory;
  memory.reserve(scratch.size());
  for (cpu::GrowBuffer& buffer : scratch) memory.push_back(buffer.reserve<double>(largest));
  cpu::parallel_for(workers, static_cast<int>(runs), [&](int run, int worker) {
    const Offset end = smaller_of(envs, (run + 1) * kRun);
    for (Offset env = run * kRun; env < end; ++env) kernel.run(job, env, memory[static_cast<std::size_t>(worker)]);
  });
}

/// The kernel for every environment of J and M. The arrays that are assembled, and what goes between the parts, live as
/// long as the call.
template <class Real, class Job>
void for_each_jacobian(Job job, int threads, const cpu::DerivativeKernel<Job>& kernel) {
  const JacobianBatchView<Real>& batch = job.assembly.batch;
  const auto assembled = make_cpu_jacobian_machine<Real>(FactorUse::by_size, threads);
  const auto size = static_cast<std::size_t>(job.contact.count * batch.row_count);
  std::vector<Real> in(size), out(size);
  job.connect(assembled->lay_out(batch, StreamRef::default_stream()), in.data(), out.data());
  for_each_env(job, batch.env_count, threads, kernel);
}

class CpuDerivativeMachine final : public DerivativeMachine {
 public:
  explicit CpuDerivativeMachine(int threads) : threads_(threads) {}

  void vjp(const VjpJob<float>& job, StreamRef) override { run(job, pick<float>().vjp); }
  void vjp(const VjpJob<double>& job, StreamRef) override { run(job, pick<double>().vjp); }
  void jvp(const JvpJob<float>& job, StreamRef) override { run(job, pick<float>().jvp); }
  void jvp(const JvpJob<double>& job, StreamRef) override { run(job, pick<double>().jvp); }
  void vjp(const JacobianVjpJob<float>& job, StreamRef) override {
    run_jacobian<float>(job, pick<float>().jacobian_vjp);
  }
  void vjp(const JacobianVjpJob<double>& job, StreamRef) override {
    run_jacobian<double>(job, pick<double>().jacobian_vjp);
  }
  void jvp(const JacobianJvpJob<float>& job, StreamRef) override {
    run_jacobian<float>(job, pick<float>().jacobian_jvp);
  }
  void jvp(const JacobianJvpJob<double>& job, StreamRef) override {
    run_jacobian<double>(job, pick<double>().jacobian_jvp);
  }
  void synchronize(StreamRef) override {}

 private:
  template <class Job>
  void run(const Job& job, const cpu::DerivativeKernel<Job>& kernel) const {
    for_each_env(job, job.batch.env_count, threads_, kernel);
  }
  template <class Real, class Job>
  void run_jacobian(const Job& job, const cpu::DerivativeKernel<Job>& kernel) const {
    for_each_jacobian<Real>(job, threads_, kernel);
  }

  int threads_;
};

}  // namespace

std::unique_ptr<DerivativeMachine> make_cpu_derivative_machine(int threads) {
  return std::make_unique<CpuDerivativeMachine>(threads);
}

}  // namespace stiction
