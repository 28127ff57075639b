#include "core/runtime/jacobian_machine.hpp"

#include <type_traits>
#include <vector>

#include "cpu_fallback/isa.hpp"
#include "cpu_fallback/thread_pool.hpp"

namespace stiction {

namespace {

template <class Real>
cpu::JacobianKernels<Real> pick() {
  const cpu::JacobianKernelSet set = cpu::best_isa().jacobian();
  if constexpr (std::is_same_v<Real, float>) {
    return set.f32;
  } else {
    return set.f64;
  }
}

template <class Real, class Kernel>
void for_each_env(const JacobianJob<Real>& job, int threads, Offset (*elements)(const JacobianJob<Real>&, Offset),
                  Kernel kernel) {
  const int count = cpu::thread_count(threads);
  std::vector<std::vector<Real>> scratch(static_cast<std::size_t>(count));
  cpu::parallel_for(count, static_cast<int>(job.batch.env_count), [&](int env, int worker) {
    std::vector<Real>& memory = scratch[static_cast<std::size_t>(worker)];
    const auto needed = static_cast<std::size_t>(elements(job, env));
    if (memory.size() < needed) memory.resize(needed);
    kernel(job, env, memory.data());
  });
}

}  // namespace

template <class Real>
void assemble_on_cpu(const JacobianJob<Real>& job, int threads) {
  const cpu::JacobianKernels<Real> kernels = pick<Real>();
  for_each_env(job, threads, kernels.elements, kernels.assemble);
}

template <class Real>
void velocities_on_cpu(const JacobianJob<Real>& job, int threads) {
  const cpu::JacobianKernels<Real> kernels = pick<Real>();
  for_each_env(job, threads, kernels.elements, kernels.velocity);
}

template void assemble_on_cpu(const JacobianJob<float>&, int);
template void assemble_on_cpu(const JacobianJob<double>&, int);
template void velocities_on_cpu(const JacobianJob<float>&, int);
template void velocities_on_cpu(const JacobianJob<double>&, int);

}  // namespace stiction
