#include "cpu_fallback/tables/contact_derivative.hpp"

#include "core/algorithm/derivative/mode_pack.hpp"
#include "cpu_fallback/pack/pack_width.hpp"
#include "cpu_fallback/tables/jacobian_jvp.hpp"

namespace stiction::inline STICTION_ISA {

namespace {

template <class Job>
bool takes(const Job& job, Offset env) {
  const Index rows = job.batch.env_rows(env);
  if (rows < 1 || rows > kMostModeRows || job.batch.env_dofs(env) > 0) return false;
  return has_full_rows(slice_problem(job.batch, job.law, env));
}

#if STICTION_VECTOR_BYTES > 0
constexpr int kWidth = kSinglesAlone ? 1 : kPackWidth<double>;
constexpr Index kFewest = kWidth > 4 ? 3 : 2;  // fewer take longer in a pack than one by one

/// Packs of environments that follow one another. One whose cones would leave too much of the others' lanes empty
/// begins the next pack.
template <class Real, class Job>
void run_packs(const Job& job, const Offset* envs, Offset count, std::uint8_t* answered, cpu::Scratch& scratch) {
  const ContactBatchView<Real>& batch = job.batch;
  for (Offset first = 0; first < count;) {
    ModeSlots slots;
    Index most_cones = 0, most_rows = 0, members = 0;
    for (; members < kWidth && first + members < count; ++members) {
      const Offset env = envs[first + members];
      const Offset* const cone_rows = batch.cone_row_offsets + batch.env_cone_offsets[env];
      const Index cones = batch.env_cones(env), rows = batch.env_rows(env);
      const Index larger = max_(rows, most_rows);
      const auto size = [&](Index cone) { return static_cast<Index>(cone_rows[cone + 1] - cone_rows[cone]); };
      if (!slots.take(cones, size, larger + larger / 2)) break;
      most_rows = larger;
      most_cones = max_(cones, most_cones);
    }
    if (members >= kFewest) {
      using Workspace = ModeWorkspace<Real, kWidth>;
      const Index rows = slots.rows();
      const Workspace workspace(scratch.reserve<double>(Workspace::elements(rows, most_cones)), rows, most_cones);
      ModePack<Job, Real, kWidth>(job, envs + first, members, slots, workspace).run(answered);
    }
    first += max_(members, 1);
  }
}
#endif

template <class Real, class Job>
cpu::ModePackKernel<Job> kernel() {
#if STICTION_VECTOR_BYTES > 0
  if constexpr (kWidth > 1) return {kWidth, takes<Job>, run_packs<Real, Job>};
#endif
  return {};
}
template <class Real>
cpu::ModePackKernels<Real> kernels() {
  return {kernel<Real, VjpJob<Real>>(), kernel<Real, JvpJob<Real>>(), jacobian_jvp_all<Real>};
}

}  // namespace

cpu::ModePackKernelSet mode_pack_kernels() {
  return {kernels<float>(), kernels<double>()};
}

}  // namespace stiction::inline STICTION_ISA
