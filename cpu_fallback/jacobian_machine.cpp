#include "core/machine/jacobian_machine.hpp"

#include <limits>
#include <numeric>
#include <type_traits>
#include <vector>

#include "core/algorithm/jacobian/jacobian_batch.hpp"
#include "core/base/extents.hpp"
#include "cpu_fallback/isa.hpp"
#include "cpu_fallback/scratch.hpp"
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

/// kernel(job, env, scratch) for every environment.
template <class Real, class Kernel>
void for_each_env(const JacobianJob<Real>& job, int threads, Offset (*elements)(const JacobianJob<Real>&, Offset),
                  const Kernel& kernel) {
  const int count = cpu::thread_count(threads);
  std::vector<cpu::Scratch> scratch(static_cast<std::size_t>(count));
  cpu::parallel_for(count, static_cast<int>(job.batch.env_count), [&](int env, int worker) {
    kernel(job, env, scratch[static_cast<std::size_t>(worker)].template reserve<Real>(elements(job, env)));
  });
}

/// Sound batches of the host, in arrays that grow.
template <class Real>
class CpuJacobian final : public JacobianMachine<Real> {
 public:
  CpuJacobian(FactorUse use, int threads) : threads_(threads), parts_(kScanParts) {
    arrays_.use = use;
    arrays_.env_dofs = std::numeric_limits<Index>::max();
  }

  ContactBatchView<Real> assemble(const JacobianBatchView<Real>& batch, StreamRef) override {
    SerialTeam team;
    arrays_.env_rows = std::numeric_limits<Index>::max();
    const auto envs = static_cast<std::size_t>(batch.env_count), rows = static_cast<std::size_t>(batch.row_count);
    arrays_.flags = at_least(flags_, envs);
    arrays_.matrix = at_least(matrix_, envs + 1);
    arrays_.factor = at_least(factor_, envs + 1);
    arrays_.parts = parts_.data();
    Index largest = 0;
    for (Offset env = 0; env < batch.env_count; ++env) {
      count_env(team, JacobianBatchJob<Real>{batch, arrays_}, env);
      largest = larger_of(largest, batch.env_rows(env));
    }
    arrays_.matrix_room = std::accumulate(arrays_.matrix, arrays_.matrix + envs, Offset{0});
    arrays_.factor_room = std::accumulate(arrays_.factor, arrays_.factor + envs, Offset{0});
    arrays_.env_rows = largest;
    arrays_.row_offsets = at_least(row_offsets_, rows + 1);
    arrays_.row_counts = at_least(row_counts_, rows);
    arrays_.column_offsets = at_least(column_offsets_, rows);
    arrays_.column = at_least(column_, static_cast<std::size_t>(largest));
    std::iota(column_.begin(), column_.end(), 0);
    arrays_.A = at_least(A_, static_cast<std::size_t>(arrays_.matrix_room));
    arrays_.Y = at_least(Y_, static_cast<std::size_t>(arrays_.factor_room));
    arrays_.b = at_least(b_, rows);
    const JacobianBatchJob<Real> job{batch, arrays_};
    scan_envs(team, job);
    for (Offset env = 0; env < batch.env_count; ++env) write_rows(team, job, env);
    const cpu::JacobianKernels<Real> kernels = pick<Real>();
    for_each_env(job.job(), threads_, kernels.elements, [&](const JacobianJob<Real>& own, Offset env, Real* scratch) {
      if ((own.flags[env] & kNotAssembled) == 0) kernels.assemble(own, env, scratch);
    });
    return contact_view(batch, arrays_);
  }

  void velocities(const JacobianBatchView<Real>& batch, const JacobianSolutionView<Real>& solution,
                  StreamRef) override {
    if (solution.velocity == nullptr) return;
    velocities_on_cpu(JacobianBatchJob<Real>{batch, arrays_, solution.lambda, solution.status, solution.velocity}.job(),
                      threads_);
  }

 private:
  template <class T>
  static T* at_least(std::vector<T>& array, std::size_t size) {
    if (array.size() < size) array.resize(size);
    return array.data();
  }

  int threads_;
  JacobianArrays<Real> arrays_{};
  std::vector<std::uint32_t> flags_;
  std::vector<Offset> matrix_, factor_, parts_, row_offsets_, column_offsets_;
  std::vector<Index> row_counts_, column_;
  std::vector<Real> A_, Y_, b_;
};

}  // namespace

template <class Real>
std::unique_ptr<JacobianMachine<Real>> make_cpu_jacobian(FactorUse use, int threads) {
  return std::make_unique<CpuJacobian<Real>>(use, threads);
}

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

template std::unique_ptr<JacobianMachine<float>> make_cpu_jacobian(FactorUse, int);
template std::unique_ptr<JacobianMachine<double>> make_cpu_jacobian(FactorUse, int);
template void assemble_on_cpu(const JacobianJob<float>&, int);
template void assemble_on_cpu(const JacobianJob<double>&, int);
template void velocities_on_cpu(const JacobianJob<float>&, int);
template void velocities_on_cpu(const JacobianJob<double>&, int);

}  // namespace stiction
