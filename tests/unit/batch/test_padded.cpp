#include <gtest/gtest.h>

#include <limits>

#include "stiction/error.hpp"
#include "stiction/padded.hpp"
#include "stiction/residual.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/random_systems.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

constexpr Index kRoom = 80;
constexpr double kRubbish = -7.25;

/// Environments of 0, a few and (on the sparse side of the planner's small sizes) many rows, dense in every row.
std::vector<Environment<double>> environments() {
  std::vector<Environment<double>> all;
  for (std::uint64_t seed = 1; seed <= 9; ++seed) {
    Recipe recipe;
    recipe.seed = seed;
    recipe.contacts = seed == 4 ? 14 : static_cast<int>(seed % 4);
    recipe.others = seed == 5 ? 0 : 3;
    all.push_back(random_contacts(recipe));
  }
  all.insert(all.begin() + 2, Environment<double>{});
  return all;
}

/// Environments in padded arrays; every place that is not in use holds NaN.
struct Padded {
  PaddedLayout<double> layout;
  std::vector<double> A, b, R, mu, lo, hi;

  Padded(const std::vector<Environment<double>>& envs, MatrixRows rows, Index room) : layout(rows) {
    const auto wide = static_cast<std::size_t>(room);
    const auto put = [&](std::vector<double>& to, const std::vector<double>& from) {
      for (std::size_t i = 0; i < wide; ++i)
        to.push_back(i < from.size() ? from[i] : std::numeric_limits<double>::quiet_NaN());
    };
    for (const Environment<double>& env : envs) {
      layout.add(room, env.cones);
      put(b, env.b);
      put(R, env.R);
      put(mu, env.mu);
      put(lo, env.lo);
      put(hi, env.hi);
      const std::size_t n = env.b.size(), first = A.size();
      const auto solved = static_cast<std::size_t>(layout.rows(layout.env_count() - 1));
      std::vector<double> matrix(n * n, 0.0);
      for (std::size_t i = 0; i < n; ++i)
        for (auto k = static_cast<std::size_t>(env.row_offsets[i]);
             k < static_cast<std::size_t>(env.row_offsets[i + 1]); ++k)
          matrix[i * n + static_cast<std::size_t>(env.column[k])] = env.A[k];
      A.resize(first + wide * wide, std::numeric_limits<double>::quiet_NaN());
      for (std::size_t i = 0; i < solved; ++i)
        for (std::size_t j = 0; j < solved; ++j)
          A[first + i * (rows == MatrixRows::by_room ? wide : solved) + j] = matrix[i * n + j];
    }
  }
  [[nodiscard]] ContactBatchView<double> view(Law law) const {
    return layout.view({A.data(), b.data(), R.data(), mu.data(), lo.data(), hi.data()}, law);
  }
};

Solution<double> solve_view(const ContactBatchView<double>& view, const SolverOptions& options) {
  Solution<double> solution{std::vector<double>(static_cast<std::size_t>(view.row_count), kRubbish),
                            std::vector<double>(static_cast<std::size_t>(view.row_count), kRubbish),
                            std::vector<EnvStatus>(static_cast<std::size_t>(view.env_count))};
  const Solver solver(Device::cpu(), options);
  solver.solve(solver.plan(view), view,
               SolutionView<double>{solution.lambda.data(), solution.w.data(), solution.status.data()});
  return solution;
}

class PaddedLayouts : public ::testing::TestWithParam<MatrixRows> {};

TEST_P(PaddedLayouts, GiveTheBitsOfTheSameNumbersWithoutRoom) {
  const auto envs = environments();
  for (const Law law : kBothLaws)
    for (const SolverKind kind : kAllSolvers) {
      SCOPED_TRACE(label(kind, law));
      const auto ragged = batch_of(envs, law);
      const Solution<double> expected = solve(ragged, options(kind, 1e-6, 60));
      const Padded padded(envs, GetParam(), kRoom);
      const Solution<double> actual = solve_view(padded.view(law), options(kind, 1e-6, 60));
      EXPECT_TRUE(same_bits(std::span<const EnvStatus>(expected.status), std::span<const EnvStatus>(actual.status)));
      const auto residuals = verify(padded.view(law), std::span<const double>(actual.lambda));
      const auto judged = verify(ragged.view(), std::span<const double>(expected.lambda));
      for (std::size_t e = 0; e < envs.size(); ++e) {
        const std::size_t n = envs[e].b.size();
        const auto at = static_cast<std::size_t>(ragged.arrays().env_row_offsets[e]);
        EXPECT_TRUE(same_bits(std::span(expected.lambda).subspan(at, n),
                              std::span<const double>(actual.lambda).subspan(e * kRoom, n)));
        EXPECT_TRUE(
            same_bits(std::span(expected.w).subspan(at, n), std::span<const double>(actual.w).subspan(e * kRoom, n)));
        EXPECT_EQ(residuals[e].relative, judged[e].relative);
        for (std::size_t i = n; i < kRoom; ++i) EXPECT_EQ(actual.lambda[e * kRoom + i], kRubbish) << "row " << i;
      }
    }
}

TEST_P(PaddedLayouts, SolveWhatFitsAndSayThatMoreCame) {
  const std::vector<Environment<double>> envs{
      contact({2, 3, 4}, {-1, 0.5, 0.25}, 0.5),
      system({unilateral(), friction(3), unilateral()}, diagonal({2, 2, 2, 2, 2}), {-1, -1, 0, 0, -1})};
  auto filled = envs;
  for (auto& env : filled) {
    env.mu.resize(env.b.size(), 0.0);
    env.R.resize(env.b.size(), 0.0);
    env.lo = env.hi = env.R;
  }
  const Padded padded(filled, GetParam(), 3);
  EXPECT_EQ(padded.layout.rows(0), 3);
  EXPECT_EQ(padded.layout.rows(1), 1) << "the contact is cut by the room's end and is left out, with all behind it";
  const auto solution = solve_view(padded.view(Law::convex), options(SolverKind::pgs, 1e-9, 50));
  EXPECT_EQ(solution.status[0].flags, 0U);
  EXPECT_EQ(solution.status[1].flags, static_cast<std::uint32_t>(kFlagContactsDropped));
  EXPECT_EQ(solution.status[1].code, EnvCode::solved);
  EXPECT_EQ(solution.lambda[3], 0.5);
  EXPECT_EQ(solution.lambda[4], kRubbish);
}

INSTANTIATE_TEST_SUITE_P(MatrixRows, PaddedLayouts, ::testing::Values(MatrixRows::by_room, MatrixRows::by_rows),
                         [](const auto& one) { return one.param == MatrixRows::by_room ? "by_room" : "by_rows"; });

/// Newton Kamino's arrays. Joints are before contacts, normals last, one mu per contact, matrices at the beginning of
/// their room, contacts' mu at a separate offset.
TEST(PaddedView, NormalsMayComeLastAndMuByContact) {
  constexpr Index kWide = 24;
  constexpr std::size_t kContactWorkspace = 9;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const Law law : kBothLaws)
    for (const SolverKind kind : kAllSolvers) {
      SCOPED_TRACE(label(kind, law));
      std::vector<Environment<double>> envs;
      PaddedLayout<double> layout(MatrixRows::by_rows, RowOrder::normal_last);
      std::vector<double> A, b, R, mu, none;
      for (std::uint64_t seed = 1; seed <= 4; ++seed) {
        Recipe recipe;
        recipe.seed = seed;
        recipe.contacts = 0;
        recipe.others = static_cast<int>(3 + 3 * 5);
        Environment<double> env = random_contacts(recipe);
        const std::size_t n = env.b.size(), joints = 3;
        env.cones.assign(joints, unilateral());
        env.mu.assign(n, 0.0);
        // order[i]: our row, normal first, of Kamino's row i.
        std::vector<std::size_t> order{0, 1, 2};
        for (std::size_t c = 0; c < 5; ++c) {
          env.cones.push_back(friction(3));
          const std::size_t first = joints + 3 * c;
          mu.push_back(0.25 + 0.125 * static_cast<double>(c));
          env.mu[first + 1] = env.mu[first + 2] = mu.back();
          for (const std::size_t row : {first + 1, first + 2, first}) order.push_back(row);
        }
        layout.add(kWide, env.cones, false, static_cast<Offset>((seed - 1) * kContactWorkspace));
        mu.resize(seed * kContactWorkspace, nan);
        for (std::size_t i = 0; i < kWide; ++i) {
          b.push_back(i < n ? env.b[order[i]] : nan);
          R.push_back(i < n ? env.R[order[i]] : nan);
          for (std::size_t j = 0; j < n && i < n; ++j) A.push_back(env.A[order[i] * n + order[j]]);
        }
        A.resize(seed * kWide * kWide, nan);
        none.resize(seed * kWide, 0.0);
        envs.push_back(env);
      }
      const auto view = layout.view({A.data(), b.data(), R.data(), mu.data(), none.data(), none.data()}, law);
      EXPECT_TRUE(validate(view).empty());
      const auto expected = solve(batch_of(envs, law), options(kind, 0, 40));
      const auto actual = solve_view(view, options(kind, 0, 40));
      const auto judged = verify(batch_of(envs, law).view(), std::span<const double>(expected.lambda));
      const auto judged_here = verify(view, std::span<const double>(actual.lambda));
      for (std::size_t e = 0; e < envs.size(); ++e) {
        const std::size_t n = envs[e].b.size();
        const auto ours = [&](const std::vector<double>& padded, std::size_t row) {
          const std::size_t contact = row < 3 ? 0 : (row - 3) / 3, within = row < 3 ? row : (row - 3) % 3;
          return padded[e * kWide + (row < 3 ? row : 3 + 3 * contact + (within + 2) % 3)];
        };
        for (std::size_t i = 0; i < n; ++i) {
          EXPECT_EQ(ours(actual.lambda, i), expected.lambda[e * n + i]) << "row " << i;
          EXPECT_NEAR(ours(actual.w, i), expected.w[e * n + i], 1e-12);
        }
        EXPECT_NEAR(actual.status[e].residual_absolute, expected.status[e].residual_absolute, 1e-12);
        EXPECT_NEAR(judged_here[e].absolute, judged[e].absolute, 1e-12);
      }
    }
}

TEST(PaddedView, MuOutsideOfItsArrayAndNormalsLastInALargeSystemAreDefects) {
  const std::vector<Cone> one{friction(3)};
  const std::vector<double> zeros(1100 * 1100, 0.0);
  const double* const z = zeros.data();
  PaddedLayout<double> layout(MatrixRows::by_room, RowOrder::normal_last);
  layout.add(3, one, false, 0);
  EXPECT_THROW(layout.add(3, one), Error) << "mu per row after mu per contact";
  auto view = layout.view({z, z, z, z, z, z}, Law::convex);
  view.mu_count = 0;
  ASSERT_FALSE(validate(view).empty());
  EXPECT_NE(validate(view)[0].message.find("mu_offsets[0] = 0"), std::string::npos) << validate(view)[0].message;

  view.mu_count = std::numeric_limits<Offset>::min();
  ASSERT_FALSE(validate(view).empty());
  EXPECT_NE(validate(view)[0].message.find("mu_count = -9223372036854775808: a count must be >= 0"), std::string::npos)
      << validate(view)[0].message;

  PaddedLayout<double> large(MatrixRows::by_room, RowOrder::normal_last);
  large.add(1100, std::vector<Cone>(366, friction(3)));
  const auto defects = validate(large.view({z, z, z, z, z, z}, Law::convex));
  ASSERT_FALSE(defects.empty());
  EXPECT_TRUE(defects[0].structural);
  EXPECT_NE(defects[0].message.find("1098 rows and is not solved densely"), std::string::npos) << defects[0].message;
}

TEST(PaddedView, FlagsOfAProducerForbidASolve) {
  const auto batch = batch_of({contact({1, 1, 1}, {-1, 0, 0}, 1), contact({1, 1, 1}, {-1, 0, 0}, 1)});
  auto arrays = batch.arrays();
  arrays.env_flags = {kFlagBadMass, 0};
  const auto flagged = ContactBatch<double>::from_arrays(Law::convex, arrays);
  EXPECT_THROW((void)solve(flagged), Error);
  SolverOptions isolate;
  isolate.invalid = InvalidPolicy::isolate;
  const auto solution = solve(flagged, isolate);
  EXPECT_EQ(solution.status[0].code, EnvCode::invalid_input);
  EXPECT_EQ(solution.status[0].flags, static_cast<std::uint32_t>(kFlagBadMass));
  EXPECT_EQ(solution.lambda[0], 0.0);
  EXPECT_EQ(solution.status[1].code, EnvCode::solved);
  EXPECT_NEAR(solution.lambda[3], 1.0, 1e-4);
  EXPECT_EQ(gather(flagged, std::vector<Offset>{1, 0}).arrays().env_flags,
            (std::vector<std::uint32_t>{0, kFlagBadMass}));
}

TEST(PaddedView, CountsOutsideOfTheirRoomAreStructuralDefects) {
  Padded padded({contact({1, 1, 1}, {-1, 0, 0}, 1)}, MatrixRows::by_room, 4);
  auto view = padded.view(Law::convex);
  const Index too_many[] = {5}, negative[] = {-1};
  for (const Index* counts : {too_many, negative}) {
    view.env_row_counts = counts;
    const auto defects = validate(view);
    ASSERT_FALSE(defects.empty());
    EXPECT_TRUE(defects.front().structural);
    EXPECT_NE(defects.front().message.find("env_row_counts[0]"), std::string::npos) << defects.front().message;
    EXPECT_THROW((void)solve_view(view, {}), Error);
  }
  view = padded.view(Law::convex);
  const Index row_counts[] = {3, 5, 3, 0};
  view.row_counts = row_counts;
  EXPECT_NE(validate(view).at(0).message.find("row_counts[1] = 5"), std::string::npos);
  view = padded.view(Law::convex);
  const Offset column_offsets[] = {0, 0, 2, 0};
  view.column_offsets = column_offsets;
  EXPECT_NE(validate(view).at(0).message.find("column_offsets[2] = 2"), std::string::npos);
}

TEST(PaddedView, ALayoutRefusesWhatIsNoRoomOrCone) {
  PaddedLayout<double> layout(MatrixRows::by_room);
  const std::vector<Cone> cones{unilateral(), {ConeKind::friction, 0, -1}};
  EXPECT_THROW(layout.add(-1, {}), Error);
  EXPECT_THROW(layout.add(3, cones), Error);
  EXPECT_EQ(layout.env_count(), 0);
}

}  // namespace
