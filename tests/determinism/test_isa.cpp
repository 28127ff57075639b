#include <gtest/gtest.h>

#include <algorithm>
#include <new>
#include <string>
#include <string_view>

#include "core/base/fp_env.hpp"
#include "core/plan/plan.hpp"
#include "cpu_fallback/tables/isa.hpp"
#include "stiction/error.hpp"
#include "tests/support/machines/every_solver.hpp"
#include "tests/support/machines/plan_views.hpp"
#include "tests/support/machines/scoped_isa.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

/// A batch solved past the partition: every environment alone through the scalar, or all dense ones through one pack.
template <class Real>
class Direct {
 public:
  Direct(const ContactBatch<Real>& batch, const SolverOptions& o)
      : batch_(batch), plan_(make_plan(batch.view())), set_(cpu::best_isa().kernels(o.solver)), law_(*o.law) {
    const auto rows = static_cast<std::size_t>(batch.row_count());
    solution_.lambda.resize(rows);
    solution_.w.resize(rows);
    solution_.status.resize(static_cast<std::size_t>(batch.env_count()));
    job_.batch = batch.view();
    job_.plan = view_of(plan_);
    job_.warm_start = nullptr;
    job_.lambda = solution_.lambda.data();
    job_.w = solution_.w.data();
    job_.status = solution_.status.data();
    job_.tolerance = o.tolerance;
    job_.max_iterations = o.max_iterations;
    job_.stall_window = o.stall_window;
    job_.omega = static_cast<Real>(o.omega);
    job_.law = *o.law;
  }

  std::vector<std::uint64_t> one_by_one() {
    const ScopedFpEnv fp_env;
    for (Offset e = 0; e < batch_.env_count(); ++e) solve_alone(e);
    return env_hashes(batch_, solution_);
  }

  /// All dense environments in one run, whatever their shapes: far more padding than the partition would allow.
  std::vector<std::uint64_t> all_in_one_pack() {
    const ScopedFpEnv fp_env;
    ConeCounts slots;
    std::vector<Offset> dense;
    for (Offset e = 0; e < batch_.env_count(); ++e) {
      if (plan_.path[static_cast<std::size_t>(e)] != EnvPath::dense || !has_packs()) {
        solve_alone(e);
        continue;
      }
      dense.push_back(e);
      const ConeCounts& own = plan_.counts[static_cast<std::size_t>(e)];
      slots.free = std::max(slots.free, own.free);
      slots.unilateral = std::max(slots.unilateral, own.unilateral);
      slots.box = std::max(slots.box, own.box);
      for (Index m = 2; m <= kMaxConeRows; ++m) slots.friction[m] = std::max(slots.friction[m], own.friction[m]);
    }
    if (!dense.empty()) {
      Scratch memory(packs().elements(slots));
      packs().solve(job_, dense.data(), static_cast<Offset>(dense.size()), slots, memory.data);
    }
    return env_hashes(batch_, solution_);
  }

  [[nodiscard]] bool has_packs() const { return packs().width > 1; }

 private:
  [[nodiscard]] const cpu::PackKernels<Real>& packs() const { return set_.packs.template of<Real>(law_); }

  struct Scratch {
    explicit Scratch(Offset elements)
        : data(static_cast<Real*>(::operator new(static_cast<std::size_t>(elements + 1) * sizeof(Real), kAlignment))) {}
    ~Scratch() { ::operator delete(data, kAlignment); }
    Scratch(const Scratch&) = delete;
    Scratch& operator=(const Scratch&) = delete;
    static constexpr std::align_val_t kAlignment{64};
    Real* data;
  };

  void solve_alone(Offset env) {
    const cpu::SingleKernels<Real>& single = cpu::of_precision<Real>(set_.single);
    Scratch memory(single.elements(job_, env));
    single.solve(job_, env, memory.data);
  }

  const ContactBatch<Real>& batch_;
  PlanData plan_;
  cpu::KernelSet set_;
  Law law_;
  Solution<Real> solution_;
  cpu::Job<Real> job_{};
};

template <class Real>
class Isa : public testing::Test {};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(Isa, Precisions);

TYPED_TEST(Isa, EveryBuildPackedOrScalarGivesEveryEnvironmentTheSameBits) {
  const auto isas = usable_isas();
  const auto has_packs = [](const char* name) {
    const ScopedIsa isa(name);
    return cpu::best_isa().kernels(SolverKind::npgs).packs.template of<TypeParam>(Law::convex).width > 1;
  };
  EXPECT_TRUE(isas.size() == 1 || std::any_of(isas.begin(), isas.end(), has_packs)) << "no build packs environments";
  if (isas.size() == 1) GTEST_SKIP() << "this CPU runs the baseline build only: there is nothing to compare it with";
  const ContactBatch<double> ragged = ragged_batch(2, 5);
  for (const SolverKind solver : kEveryChoice) {
    const ContactBatch<TypeParam> batch = batch_for<TypeParam>(solver, ragged, 200);
    for (const Law law : kBothLaws) {
      SolverOptions o = options(solver, 1e-3, few_iterations(solver, 22));
      o.law = law;
      std::vector<std::uint64_t> expected;
      for (const char* name : isas) {
        SCOPED_TRACE(label(solver, law) + ", " + name);
        const ScopedIsa isa(name);
        const auto dealt_out = solve_hashes(batch, o);
        if (expected.empty()) expected = dealt_out;
        EXPECT_EQ(dealt_out, expected) << "as solve() deals them out";
        // The fallback chain has no kernels but its stages'.
        if (solver == SolverKind::automatic) continue;
        Direct<TypeParam> direct(batch, o);
        EXPECT_EQ(direct.one_by_one(), expected) << "scalar";
        EXPECT_EQ(direct.all_in_one_pack(), expected) << "one pack";
      }
    }
  }
}

TYPED_TEST(Isa, ABatchOfOneIsSolvedLikeTheSameEnvironmentInAPack) {
  const auto envs = scene_batch("walker", 24, 6);
  const ContactBatch<TypeParam> batch = convert<TypeParam>(envs);
  for (const char* name : usable_isas()) {
    SCOPED_TRACE(name);
    const ScopedIsa isa(name);
    const SolverOptions o = options(SolverKind::npgs, 1e-4, 50);
    const auto together = solve_hashes(batch, o);
    for (Offset e = 0; e < batch.env_count(); ++e) {
      const Offset order[] = {e};
      EXPECT_EQ(solve_hashes(gather<TypeParam>(batch, order), o).at(0), together[static_cast<std::size_t>(e)]) << e;
    }
  }
}

TEST(IsaChoice, AnUnknownNameIsRefusedWithThoseThatThereAre) {
  const ScopedIsa isa("mmx");
  try {
    const Solver solver(Device::cpu(), SolverOptions{});
    ADD_FAILURE() << "made a solver";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::invalid_argument);
    const std::string said = error.what();
    EXPECT_EQ(said.find("STICTION_ISA = 'mmx': expected one of widest, "), 0U) << said;
    for (const char* name : usable_isas()) EXPECT_NE(said.find(name), std::string::npos) << name << " in " << said;
  }
}

TEST(IsaChoice, TheWidestBuildIsTakenIfItIsNamedOrNothingIs) {
  for (const char* name : {"widest", ""}) {
    const ScopedIsa isa(name);
    EXPECT_EQ(cpu::best_isa().name, std::string(usable_shipped_isas().back())) << "'" << name << "'";
  }
}

TEST(IsaChoice, AProcessorThatRunsNoneIsToldHowToBuild) {
  cpu::Isa other{}, own{};
  other.name = "other";
  other.supported = [] { return false; };
  own.name = "own";
  own.supported = [] { return true; };
  EXPECT_STREQ(cpu::widest_isa(std::vector{other, own}).name, "own");
  try {
    cpu::widest_isa(std::vector{other});
    ADD_FAILURE() << "took one that this processor does not run";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::unsupported);
    EXPECT_STREQ(
        error.what(),
        "this processor runs none of the kernels of this build (other): build with -DSTICTION_CPU_KERNELS=all");
  }
}

TEST(IsaChoice, TheBuildThatTheEnvironmentAsksForIsTheOneThatRuns) {
  const char* wanted = std::getenv("STICTION_ISA");
  if (wanted == nullptr) GTEST_SKIP() << "STICTION_ISA is not set";
  if (cpu::find_isa(wanted) == nullptr) GTEST_SKIP() << wanted << " not run here";
  EXPECT_STREQ(cpu::best_isa().name, wanted);
}

class ShippedIsa : public testing::TestWithParam<const char*> {};

TEST_P(ShippedIsa, RunsHere) {
  if (cpu::find_isa(GetParam()) == nullptr) GTEST_SKIP() << GetParam() << " not run here";
  const ScopedIsa isa(GetParam());
  EXPECT_STREQ(cpu::best_isa().name, GetParam());
}

INSTANTIATE_TEST_SUITE_P(Isa, ShippedIsa, testing::ValuesIn(kShippedIsas),
                         [](const auto& name) { return std::string(name.param); });

#if defined(STICTION_TEST_PACK_WIDTHS)  // those that a build has: a sanitizer's is without packs of 16 bytes
TEST(PackWidths, OfSixteenBytesAreTestedAnywhereThoseOfSixtyFourWhereverAvx2Runs) {
  for (const auto& [name, bytes] : {std::pair{"narrow", 16}, std::pair{"wide", 64}}) {
    SCOPED_TRACE(name);
    if (std::string_view(STICTION_TEST_PACK_WIDTHS).find(name) == std::string_view::npos) continue;
    const cpu::Isa* isa = cpu::find_isa(name);
    if (bytes > 16 && cpu::find_isa("avx2") == nullptr) GTEST_SKIP() << "avx2 not run here, nor packs of 64 bytes";
    ASSERT_NE(isa, nullptr);
    for (const SolverKind solver : kAllSolvers)
      for (const Law law : kBothLaws) {
        const cpu::KernelSet set = isa->kernels(solver);
        EXPECT_EQ(set.packs.of<float>(law).width, bytes / 4) << label(solver, law);
        EXPECT_EQ(set.packs.of<double>(law).width, bytes / 8) << label(solver, law);
        EXPECT_EQ(isa->body_kernels().packs.of<float>(law).width, bytes / 4) << to_string(law);
        EXPECT_EQ(isa->body_kernels().packs.of<double>(law).width, bytes / 8) << to_string(law);
      }
  }
}
#endif

}  // namespace
