#include "core/machine/derivative_machine.hpp"

#include <algorithm>
#include <cstdint>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/base/extents.hpp"
#include "core/machine/jacobian_machine.hpp"
#include "cpu_fallback/machine/jacobian_pack_parts.hpp"
#include "cpu_fallback/machine/run_length.hpp"
#include "cpu_fallback/tables/isa.hpp"
#include "cpu_fallback/tables/scratch.hpp"
#include "cpu_fallback/threads/thread_pool.hpp"

namespace stiction {

namespace {

template <class Real>
cpu::DerivativeKernels<Real> pick() {
  return cpu::of_precision<Real>(cpu::best_isa().derivative());
}

/// Environments that one thread takes at a time: less would cost more than it shares.
constexpr Offset kRun = 8;

/// The kernel for every environment, but for those that are answered. Scratch is there before it writes an output.
template <class Job>
void for_each_env(const Job& job, Offset envs, int threads, const cpu::DerivativeKernel<Job>& kernel,
                  const std::uint8_t* answered = nullptr) {
  const auto is_left = [answered](Offset env) { return answered == nullptr || answered[env] == 0; };
  const Offset runs = (envs + kRun - 1) / kRun;
  Offset largest = 0;
  for (Offset env = 0; env < envs; ++env)
    if (is_left(env)) largest = larger_of(largest, kernel.elements(job, env));
  const int workers = static_cast<int>(smaller_of<Offset>(cpu::thread_count(threads), larger_of<Offset>(runs, 1)));
  std::vector<cpu::GrowBuffer> scratch(static_cast<std::size_t>(workers));
  std::vector<double*> memory;
  memory.reserve(scratch.size());
  for (cpu::GrowBuffer& buffer : scratch) memory.push_back(buffer.reserve<double>(largest));
  cpu::parallel_for(workers, static_cast<int>(runs), [&](int run, int worker) {
    const Offset end = smaller_of(envs, (run + 1) * kRun);
    for (Offset env = run * kRun; env < end; ++env)
      if (is_left(env)) kernel.run(job, env, memory[static_cast<std::size_t>(worker)]);
  });
}

/// The kernel of a job, or of its relaxed problem where kappa is above zero. The relaxed reactions live as long as the
/// call.
template <class Real, class Job, class View>
void run_job(const Job& job, const View& batch, int threads, double kappa, const cpu::DerivativeKernel<Job>& exact,
             const cpu::DerivativeKernel<RelaxedJob<Job, Real>>& relaxed) {
  if (kappa == 0.0) return for_each_env(job, batch.env_count, threads, exact);
  std::vector<Real> lambda(static_cast<std::size_t>(batch.row_count));
  for_each_env(RelaxedJob<Job, Real>{job, kappa, lambda.data()}, batch.env_count, threads, relaxed);
}

/// The environments that packs take, like sizes side by side.
template <class Job>
std::vector<Offset> taken_by(const cpu::ModePackKernel<Job>& packs, const Job& job, int threads) {
  const auto& batch = job.batch;
  std::vector<std::uint8_t> is_taken(static_cast<std::size_t>(batch.env_count));
  cpu::parallel_for(threads, batch.env_count, [&](Offset begin, Offset end) {
    for (Offset env = begin; env < end; ++env) is_taken[static_cast<std::size_t>(env)] = packs.takes(job, env) ? 1 : 0;
  });
  std::vector<Offset> taken;
  for (Offset env = 0; env < batch.env_count; ++env)
    if (is_taken[static_cast<std::size_t>(env)] != 0) taken.push_back(env);
  std::ranges::stable_sort(taken, {}, [&](Offset env) { return std::pair(batch.env_rows(env), batch.env_cones(env)); });
  return taken;
}

/// Differentiates a batch of contacts: side by side those that packs take, one by one the others.
template <class Job>
void run_contacts(const Job& job, int threads, const cpu::ModePackKernel<Job>& packs,
                  const cpu::DerivativeKernel<Job>& alone) {
  const Offset envs = job.batch.env_count;
  if (packs.width == 1) return for_each_env(job, envs, threads, alone);
  const std::vector<Offset> taken = taken_by(packs, job, threads);
  const auto count = static_cast<Offset>(taken.size()), run = Offset{2} * packs.width;
  const int workers = cpu::thread_count(threads);
  std::vector<cpu::Scratch> scratch(static_cast<std::size_t>(workers));
  std::vector<std::uint8_t> answered(static_cast<std::size_t>(envs));
  cpu::parallel_for(workers, static_cast<int>((count + run - 1) / run), [&](int index, int worker) {
    const Offset begin = index * run;
    packs.run(job, taken.data() + begin, smaller_of(run, count - begin), answered.data(),
              scratch[static_cast<std::size_t>(worker)]);
  });
  for_each_env(job, envs, threads, alone, answered.data());
}

/// Differentiates environments in lanes by a kernel, and marks in `answered` those that it has answered. Scratch grows
/// with the packs, whose size is known when they are merged.
template <class Real, class Job, class Kernel>
void run_lanes(const Job& job, int threads, Kernel kernel, std::uint8_t* answered) {
  cpu::JacobianPackParts<Real, Job> parts(job);
  const std::span<const LaneEnv<Real>> all = parts.all();
  const Index width = cpu::of_precision<Real>(cpu::best_isa().velocity()).width;
  const int workers = cpu::thread_count(threads);
  const auto count = static_cast<Offset>(all.size()), run = cpu::run_length(count, width, workers);
  std::vector<cpu::VelocityScratch> scratch(static_cast<std::size_t>(workers));
  cpu::parallel_for(workers, static_cast<int>((count + run - 1) / run), [&](int index, int worker) {
    const Offset begin = index * run;
    kernel(job, all.data() + begin, parts.results() + begin, smaller_of(run, count - begin),
           scratch[static_cast<std::size_t>(worker)]);
  });
  parts.finish(answered);
}

/// A job of J and M. The arrays that are assembled, and those between the parts, live as long as the call.
template <class Real, class Job>
void run_jacobian_job(Job job, int threads, double kappa, const cpu::DerivativeKernel<Job>& exact,
                      const cpu::DerivativeKernel<RelaxedJob<Job, Real>>& relaxed) {
  const JacobianBatchView<Real>& batch = job.assembly.batch;
  const auto assembled = make_cpu_jacobian_machine<Real>(FactorUse::by_size, threads);
  const auto size = static_cast<std::size_t>(job.contact.count * batch.row_count);
  std::vector<Real> in(size), out(size);
  job.connect(assembled->lay_out(batch, StreamRef::default_stream()), in.data(), out.data());
  if (kappa != 0.0 || job.contact.law != Law::convex) return run_job<Real>(job, batch, threads, kappa, exact, relaxed);
  std::vector<std::uint8_t> answered(static_cast<std::size_t>(batch.env_count));
  if constexpr (std::is_same_v<Job, JacobianVjpJob<Real>>) {
    const auto dofs = static_cast<std::size_t>(batch.dof_count);
    std::vector<Real> adjoint(dofs * static_cast<std::size_t>(job.contact.count)), moved(dofs);
    job.lanes = {adjoint.data(), moved.data(), answered.data()};
    run_lanes<Real>(job, threads, cpu::of_precision<Real>(cpu::best_isa().velocity()).vjp, answered.data());
    for_each_env(job, batch.env_count, threads, exact);
  } else {
    run_lanes<Real>(job, threads, pick<Real>().packs.jacobian_jvp, answered.data());
    for_each_env(job, batch.env_count, threads, exact, answered.data());
  }
}

class CpuDerivativeMachine final : public DerivativeMachine {
 public:
  CpuDerivativeMachine(int threads, double kappa) : threads_(threads), kappa_(kappa) {}

  void vjp(const VjpJob<float>& job, StreamRef) override { run_vjp(job); }
  void vjp(const VjpJob<double>& job, StreamRef) override { run_vjp(job); }
  void jvp(const JvpJob<float>& job, StreamRef) override { run_jvp(job); }
  void jvp(const JvpJob<double>& job, StreamRef) override { run_jvp(job); }
  void vjp(const JacobianVjpJob<float>& job, StreamRef) override { run_vjp(job); }
  void vjp(const JacobianVjpJob<double>& job, StreamRef) override { run_vjp(job); }
  void jvp(const JacobianJvpJob<float>& job, StreamRef) override { run_jvp(job); }
  void jvp(const JacobianJvpJob<double>& job, StreamRef) override { run_jvp(job); }
  void unrolled_vjp(const UnrolledJob<float>& job, StreamRef) override { run_unrolled(job); }
  void unrolled_vjp(const UnrolledJob<double>& job, StreamRef) override { run_unrolled(job); }
  void synchronize(StreamRef) override {}

 private:
  template <class Real>
  void run_vjp(const VjpJob<Real>& job) const {
    const cpu::DerivativeKernels<Real> kernels = pick<Real>();
    if (kappa_ == 0.0) return run_contacts(job, threads_, kernels.packs.vjp, kernels.vjp);
    run_job<Real>(job, job.batch, threads_, kappa_, kernels.vjp, kernels.relaxed_vjp);
  }
  template <class Real>
  void run_jvp(const JvpJob<Real>& job) const {
    const cpu::DerivativeKernels<Real> kernels = pick<Real>();
    if (kappa_ == 0.0) return run_contacts(job, threads_, kernels.packs.jvp, kernels.jvp);
    run_job<Real>(job, job.batch, threads_, kappa_, kernels.jvp, kernels.relaxed_jvp);
  }
  template <class Real>
  void run_vjp(const JacobianVjpJob<Real>& job) const {
    run_jacobian_job<Real>(job, threads_, kappa_, pick<Real>().jacobian_vjp, pick<Real>().relaxed_jacobian_vjp);
  }
  template <class Real>
  void run_jvp(const JacobianJvpJob<Real>& job) const {
    run_jacobian_job<Real>(job, threads_, kappa_, pick<Real>().jacobian_jvp, pick<Real>().relaxed_jacobian_jvp);
  }
  template <class Real>
  void run_unrolled(const UnrolledJob<Real>& job) const {
    for_each_env(job, job.batch.env_count, threads_, pick<Real>().unrolled_vjp);
  }

  int threads_;
  double kappa_;
};

}  // namespace

std::unique_ptr<DerivativeMachine> make_cpu_derivative_machine(int threads, double kappa) {
  return std::make_unique<CpuDerivativeMachine>(threads, kappa);
}

}  // namespace stiction
