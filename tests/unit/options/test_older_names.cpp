#include <gtest/gtest.h>

#include <array>

#include "stiction/status.hpp"
#include "stiction/warm_start.hpp"

/// Names of the public interface from before numerics epoch 2, which are kept until 1.0.
namespace stiction::test {
namespace {

TEST(OlderNames, FlagsAreThoseOfToday) {
  EXPECT_EQ(kFlagCapacity, kFlagContactsDropped);
  EXPECT_EQ(kFlagNoRoom, kFlagOverCapacity);
}

/// Stores three numbers of one contact by remember() and expects recall() to serve them.
template <class View, class SolutionOf>
void expect_remembered(const View& view, const SolutionOf& solution_of) {
  const std::uint64_t id = 7;
  std::array<double, 3> lambda{4.0, 2.0, 1.0}, guess{77.0, 77.0, 77.0};
  EnvStatus status{};
  status.code = EnvCode::solved;
  WarmStartStore<double> store(Device::cpu(), {1, 1, 3}, {0.5});
  store.remember(view, &id, solution_of(lambda.data(), &status), 0.01);
  store.recall(view, &id, 0.01, guess.data());
  EXPECT_EQ(guess, (std::array<double, 3>{2.0, 1.0, 0.5}));
}

const Offset kOneCone[] = {0, 1};
const Offset kThreeRows[] = {0, 3};
const ConeKind kFriction[] = {ConeKind::friction};

template <class View>
View one_contact() {
  View view{};
  view.env_count = 1;
  view.cone_count = 1;
  view.row_count = 3;
  view.env_row_offsets = kThreeRows;
  view.env_cone_offsets = kOneCone;
  view.cone_row_offsets = kThreeRows;
  view.cone_kind = kFriction;
  return view;
}

TEST(OlderNames, AWarmStartIsRememberedAndRecalled) {
  expect_remembered(one_contact<ContactBatchView<double>>(),
                    [](double* lambda, EnvStatus* status) { return SolutionView<double>{lambda, nullptr, status}; });
  expect_remembered(one_contact<JacobianBatchView<double>>(), [](double* lambda, EnvStatus* status) {
    return JacobianSolutionView<double>{lambda, nullptr, nullptr, status};
  });
  BodyBatchView<double> bodies{};
  bodies.env_count = 1;
  bodies.contact_count = 1;
  bodies.env_contact_offsets = kOneCone;
  expect_remembered(bodies, [](double* impulse, EnvStatus* status) {
    return BodySolutionView<double>{impulse, nullptr, nullptr, status};
  });
}

}  // namespace
}  // namespace stiction::test
