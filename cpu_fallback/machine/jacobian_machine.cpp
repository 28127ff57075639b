#include "core/machine/jacobian_machine.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <span>
#include <vector>

#include "core/algorithm/jacobian/jacobian_batch.hpp"
#include "core/base/extents.hpp"
#include "cpu_fallback/machine/run_length.hpp"
#include "cpu_fallback/machine/velocity_parts.hpp"
#include "cpu_fallback/tables/isa.hpp"
#include "cpu_fallback/tables/scratch.hpp"
#include "cpu_fallback/threads/thread_pool.hpp"

namespace stiction {

namespace {

template <class Real>
cpu::JacobianKernels<Real> pick() {
  return cpu::of_precision<Real>(cpu::best_isa().jacobian());
}

/// kernel(job, env, scratch) for every environment; scratch() is memory for as many elements as it needs.
template <class Real, class Kernel>
void for_each_env(const JacobianJob<Real>& job, int threads, Offset (*elements)(const JacobianJob<Real>&, Offset),
                  const Kernel& kernel) {
  const int count = cpu::thread_count(threads);
  std::vector<cpu::Scratch> scratch(static_cast<std::size_t>(count));
  cpu::parallel_for(count, static_cast<int>(job.batch.env_count), [&](int env, int worker) {
    kernel(job, Offset{env},
           [&] { return scratch[static_cast<std::size_t>(worker)].template reserve<Real>(elements(job, env)); });
  });
}

/// Sound batches of the host, in arrays that grow.
template <class Real>
class CpuJacobianMachine final : public JacobianMachine<Real> {
 public:
  CpuJacobianMachine(FactorUse use, int threads) : threads_(threads), scan_parts_(kScanParts) {
    arrays_.use = use;
    arrays_.env_dofs = std::numeric_limits<Index>::max();
  }

  bool solve_velocities(const VelocityJob<Real>& job, StreamRef) override {
    largest_ = count(job.batch, true);
    return solve_by_newton(job) == job.batch.env_count;
  }

  ContactBatchView<Real> assemble(const JacobianBatchView<Real>& batch, StreamRef) override {
    const JacobianBatchJob<Real> job = place(batch, largest_ >= 0 ? largest_ : count(batch, false));
    largest_ = -1;
    const cpu::JacobianKernels<Real> kernels = pick<Real>();
    for_each_env(job.job(), threads_, kernels.elements, [&](const JacobianJob<Real>& own, Offset env, auto&& scratch) {
      if ((own.flags[env] & kNotAssembled) == 0 && !is_answered(arrays_, env)) kernels.assemble(own, env, scratch());
    });
    return contact_view(batch, arrays_);
  }

  JacobianBatchJob<Real> lay_out(const JacobianBatchView<Real>& batch, StreamRef) override {
    return place(batch, count(batch, false));
  }

  void write(const JacobianBatchView<Real>& batch, const JacobianSolutionView<Real>& solution, StreamRef) override {
    largest_ = -1;
    const cpu::JacobianKernels<Real> kernels = pick<Real>();
    const JacobianBatchJob<Real> job{batch, arrays_, solution.lambda, solution.status, solution.velocity};
    for_each_env(job.job(), threads_, kernels.elements, [&](const JacobianJob<Real>& own, Offset env, auto&& scratch) {
      if (is_answered(arrays_, env)) {
        copy_answer(batch, env, solution);
      } else if (solution.velocity != nullptr) {
        kernels.velocity(own, env, scratch());
      }
    });
  }

 private:
  template <class T>
  static T* at_least(std::vector<T>& array, std::size_t size) {
    if (array.size() < size) array.resize(size);
    return array.data();
  }

  /// Counts the memory of each environment. Returns the rows of the largest.
  Index count(const JacobianBatchView<Real>& batch, bool by_newton) {
    SerialTeam team;
    arrays_.env_rows = std::numeric_limits<Index>::max();
    const auto envs = static_cast<std::size_t>(batch.env_count);
    arrays_.flags = at_least(flags_, envs);
    arrays_.matrix = at_least(matrix_, envs + 1);
    arrays_.factor = at_least(factor_, envs + 1);
    arrays_.parts = scan_parts_.data();
    reserve_answers(batch, by_newton);
    Index largest = 0;
    for (Offset env = 0; env < batch.env_count; ++env) {
      count_env(team, JacobianBatchJob<Real>{batch, arrays_}, env);
      largest = larger_of(largest, batch.env_rows(env));
    }
    return largest;
  }

  /// Finds the place of each environment, and its rows.
  JacobianBatchJob<Real> place(const JacobianBatchView<Real>& batch, Index largest) {
    SerialTeam team;
    const auto envs = static_cast<std::size_t>(batch.env_count), rows = static_cast<std::size_t>(batch.row_count);
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
    return job;
  }

  /// Room for the results of Newton's method in velocities. Answers are kept here until all else is solved: a solve
  /// that throws must have written nothing.
  void reserve_answers(const JacobianBatchView<Real>& batch, bool by_newton) {
    const std::size_t envs = by_newton ? static_cast<std::size_t>(batch.env_count) : 0;
    arrays_.answered = by_newton ? at_least(answered_, envs + 1) : nullptr;
    arrays_.env_row_counts = at_least(env_row_counts_, envs);
    arrays_.env_cone_counts = at_least(env_cone_counts_, envs);
    arrays_.status = at_least(status_, envs);
    if (!by_newton) return;
    const auto rows = static_cast<std::size_t>(batch.row_count);
    answers_ = {at_least(lambda_, rows), at_least(w_, rows),
                at_least(velocity_, static_cast<std::size_t>(batch.dof_count)), arrays_.status};
  }

  /// Newton's method on the environments it takes. Returns how many environments were solved.
  Offset solve_by_newton(const VelocityJob<Real>& newton) {
    VelocityJob<Real> job = newton;
    job.to = answers_;
    job.answered = arrays_.answered;
    const std::span<const LaneEnv<Real>> parts = newton_parts_.list(job, arrays_.flags);
    const cpu::VelocityKernels<Real> kernels = cpu::of_precision<Real>(cpu::best_isa().velocity());
    const int threads = cpu::thread_count(threads_);
    if (newton_scratch_.size() < static_cast<std::size_t>(threads))
      newton_scratch_ = std::vector<cpu::VelocityScratch>(static_cast<std::size_t>(threads));
    const auto count = static_cast<Offset>(parts.size()), run = cpu::run_length(count, kernels.width, threads);
    // Small parts come first, in packs; a large one is work enough by itself.
    const auto is_small = [](const LaneEnv<Real>& part) { return part.dofs <= kMostVelocityDofs; };
    const Offset small = std::partition_point(parts.begin(), parts.end(), is_small) - parts.begin();
    const Offset runs = (small + run - 1) / run;
    cpu::parallel_for(threads, static_cast<int>(runs + count - small), [&](int index, int worker) {
      const Offset begin = index < runs ? index * run : small + index - runs;
      kernels.solve(job, parts.data() + begin, index < runs ? smaller_of(run, small - begin) : 1,
                    newton_scratch_[static_cast<std::size_t>(worker)]);
    });
    newton_parts_.finish(job);
    const std::span<const LaneEnv<Real>> in_blocks = newton_parts_.list_blocks(job, arrays_.flags);
    cpu::parallel_for(threads, static_cast<int>(in_blocks.size()), [&](int index, int worker) {
      const LaneEnv<Real>& env = in_blocks[static_cast<std::size_t>(index)];
      cpu::VelocityScratch& scratch = newton_scratch_[static_cast<std::size_t>(worker)];
      finish(job, env.env, pick<Real>().solve_in_blocks(job, env, scratch));
    });
    Offset solved = 0;
    for (Offset env = 0; env < job.batch.env_count; ++env) {
      leave_out_answered(arrays_, env);
      solved += arrays_.answered[env];
    }
    return solved;
  }

  /// Copies one environment's answer to the solution.
  void copy_answer(const JacobianBatchView<Real>& batch, Offset env, const JacobianSolutionView<Real>& solution) const {
    const Offset row = batch.env_row_offsets[env], dof = batch.env_dof_offsets[env];
    std::copy_n(answers_.lambda + row, batch.env_rows(env), solution.lambda + row);
    if (solution.w != nullptr) std::copy_n(answers_.w + row, batch.env_rows(env), solution.w + row);
    if (solution.velocity != nullptr)
      std::copy_n(answers_.velocity + dof, batch.env_dofs(env), solution.velocity + dof);
    solution.status[env] = answers_.status[env];
  }

  int threads_;
  Index largest_ = -1;  ///< rows of the largest environment, while a solve's environments are counted
  JacobianArrays<Real> arrays_{};
  JacobianSolutionView<Real> answers_{};
  std::vector<std::uint32_t> flags_;
  std::vector<Offset> matrix_, factor_, scan_parts_, row_offsets_, column_offsets_;
  std::vector<Index> row_counts_, column_;
  std::vector<Real> A_, Y_, b_;
  std::vector<std::uint8_t> answered_;
  std::vector<Index> env_row_counts_, env_cone_counts_;
  std::vector<EnvStatus> status_;
  std::vector<Real> lambda_, w_, velocity_;
  cpu::VelocityParts<Real> newton_parts_;
  std::vector<cpu::VelocityScratch> newton_scratch_;  ///< of every worker
};

}  // namespace

template <class Real>
std::unique_ptr<JacobianMachine<Real>> make_cpu_jacobian_machine(FactorUse use, int threads) {
  return std::make_unique<CpuJacobianMachine<Real>>(use, threads);
}

template <class Real>
void assemble_on_cpu(const JacobianJob<Real>& job, int threads) {
  const cpu::JacobianKernels<Real> kernels = pick<Real>();
  for_each_env(job, threads, kernels.elements, [&](const JacobianJob<Real>& own, Offset env, auto&& scratch) {
    kernels.assemble(own, env, scratch());
  });
}

template <class Real>
void velocities_on_cpu(const JacobianJob<Real>& job, int threads) {
  const cpu::JacobianKernels<Real> kernels = pick<Real>();
  for_each_env(job, threads, kernels.elements, [&](const JacobianJob<Real>& own, Offset env, auto&& scratch) {
    kernels.velocity(own, env, scratch());
  });
}

template std::unique_ptr<JacobianMachine<float>> make_cpu_jacobian_machine(FactorUse, int);
template std::unique_ptr<JacobianMachine<double>> make_cpu_jacobian_machine(FactorUse, int);
template void assemble_on_cpu(const JacobianJob<float>&, int);
template void assemble_on_cpu(const JacobianJob<double>&, int);
template void velocities_on_cpu(const JacobianJob<float>&, int);
template void velocities_on_cpu(const JacobianJob<double>&, int);

}  // namespace stiction
