#include <gtest/gtest.h>

#include "stiction/error.hpp"
#include "stiction/recorder.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/machines/every_solver.hpp"
#include "tests/unit/io/test_io_support.hpp"

// Solvers that are chosen by the spectrum, in files.
namespace stiction::io::test {
namespace {

using stiction::test::options;
using stiction::test::ragged_batch;
using stiction::test::same_bits;
using stiction::test::up_to;

class RecordedChoice : public Folder {
 protected:
  RecordedChoice() {
    options_.choose = SolverChoice::spectrum;
    options_.invalid = InvalidPolicy::isolate;
    options_.spectrum.direct_condition = 40;
    options_.spectrum.otherwise = SolverKind::apgd;
  }
  /// Solves and records everything.
  Solution<double> record() {
    Solution<double> answer = solve(batch_, options_);
    Recorder recorder(at("choice.h5"), {RecordWhen::always, 1000, {}});
    const Solver solver(Device::cpu(), options_);
    (void)recorder.take(solver, batch_.view(), {answer.lambda.data(), answer.w.data(), answer.status.data()});
    return answer;
  }

  ContactBatch<double> batch_ = up_to(ragged_batch(1, 7), 60);
  SolverOptions options_ = options(SolverKind::npgs, 1e-6, 50);
};

TEST_F(RecordedChoice, IsReplayedByItsRules) {
  const Solution<double> answer = record();
  const Recording recording = read_batch(at("choice.h5"));
  EXPECT_EQ(recording.solve->choose, SolverChoice::spectrum);
  EXPECT_EQ(recording.solve->spectrum, options_.spectrum);
  SolverOptions again = options(recording.solve->solver, recording.solve->tolerance, recording.solve->max_iterations);
  again.choose = recording.solve->choose;
  again.spectrum = recording.solve->spectrum;
  again.invalid = InvalidPolicy::isolate;
  const Solution<double> replayed = solve(recording.batch, again);
  EXPECT_TRUE(same_bits(std::span<const double>(answer.lambda), std::span<const double>(replayed.lambda)));
  again.spectrum = {};
  again.spectrum.direct = again.spectrum.preconditioned = SolverKind::jacobi;
  EXPECT_FALSE(same_bits(answer, solve(recording.batch, again))) << "the rules reach the bits";
}

TEST_F(RecordedChoice, IsRefusedWhereItDependsOnWhatCameBefore) {
  options_.spectrum.keep = true;
  EXPECT_THROW(record(), Error);
}

TEST_F(RecordedChoice, RulesThatAreNoneAreRefused) {
  record();
  Recording recording = read_batch(at("choice.h5"));
  recording.solve->spectrum.steps = -3;
  write_batch(at("broken.h5"), recording);
  EXPECT_THROW(read_batch(at("broken.h5")), Error);
}

}  // namespace
}  // namespace stiction::io::test
