#include "stiction/recorder.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "scenes/merge.hpp"
#include "stiction/hash.hpp"
#include "stiction/padded.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/small_systems.hpp"
#include "tests/unit/io/test_io_support.hpp"

namespace stiction::io::test {
namespace {

using stiction::test::env_hashes;
using stiction::test::kAllSolvers;
using stiction::test::options;
using stiction::test::ragged_batch;

/// A file's environments solved by nothing but the file's options.
template <class Real>
std::vector<Real> replayed(const Recording& recording) {
  const RecordedSolve& solve = recording.solve.value();
  SolverOptions o;
  o.solver = solve.solver;
  o.tolerance = solve.tolerance;
  o.absolute_tolerance = solve.absolute_tolerance;
  o.omega = solve.omega;
  o.max_iterations = solve.max_iterations;
  o.stall_window = solve.stall_window;
  o.islands = solve.islands;
  o.invalid = InvalidPolicy::isolate;
  o.threads = 1;
  const std::vector<Real> warm(solve.warm_start.begin(), solve.warm_start.end());
  return stiction::solve(convert<Real>(recording.batch), o, Device::cpu(), std::span<const Real>(warm)).lambda;
}

template <class Real>
void expect_replays(const std::filesystem::path& path) {
  const Recording recording = read_batch(path);
  const std::vector<Real> lambda = replayed<Real>(recording);
  const std::vector<Real> then(recording.solve->lambda.begin(), recording.solve->lambda.end());
  expect_same_bits(lambda, then, "lambda");
}

template <class Real>
struct Solved {
  Solved(const Solver& solver, const ContactBatchView<Real>& batch, const Real* warm_start = nullptr)
      : lambda(static_cast<std::size_t>(batch.row_count), Real(77)), status(static_cast<std::size_t>(batch.env_count)) {
    solver.solve(batch, view(), warm_start);
    solver.synchronize();
  }
  SolutionView<Real> view() { return {lambda.data(), nullptr, status.data()}; }
  std::vector<Real> lambda;
  std::vector<EnvStatus> status;
};

class RecorderTest : public Folder {};

TEST_F(RecorderTest, EverySolverAndPrecisionReplaysToTheBit) {
  for (const SolverKind kind : kAllSolvers) {
    const auto record = [&](const auto& batch, auto zero) {
      using Real = decltype(zero);
      SolverOptions o = options(kind, 1e-5, 13);
      o.stall_window = 9;
      o.omega = 0.9;
      o.law = Law::coulomb;
      const Solver solver(Device::cpu(), o);
      std::vector<Real> warm(static_cast<std::size_t>(batch.row_count()));
      for (std::size_t i = 0; i < warm.size(); ++i) warm[i] = static_cast<Real>(0.01) * static_cast<Real>(i % 5);
      Solved<Real> solved(solver, batch.view(), warm.data());
      Recorder recorder(at("r.h5"), {RecordWhen::always, 1000, {}});
      EXPECT_EQ(recorder.take(solver, batch.view(), solved.view(), warm.data()), batch.env_count());
      const Recording file = read_batch(at("r.h5"));
      EXPECT_EQ(file.batch.law(), Law::coulomb);
      EXPECT_EQ(file.solve->precision, sizeof(Real) == 4 ? Precision::f32 : Precision::f64);
      expect_same_bits(std::vector<Real>(file.solve->lambda.begin(), file.solve->lambda.end()), solved.lambda, "all");
      expect_replays<Real>(at("r.h5"));
      // The warm start matters here, so that a file without it would not replay.
      EXPECT_NE(hash_bits(std::span<const Real>(Solved<Real>(solver, batch.view()).lambda)),
                hash_bits(std::span<const Real>(solved.lambda)));
    };
    record(ragged_batch(2, 5), 0.0);
    record(convert<float>(ragged_batch(2, 5)), 0.0F);
  }
}

TEST_F(RecorderTest, AnAbsoluteToleranceIsRecorded) {
  const ContactBatch<double> batch = ragged_batch(2, 5);
  SolverOptions o = options(SolverKind::npgs, 1e-10, 200);
  const Solved<double> exact(Solver(Device::cpu(), o), batch.view());
  o.absolute_tolerance = 1e-2;
  const Solver solver(Device::cpu(), o);
  Solved<double> solved(solver, batch.view());
  EXPECT_NE(exact.lambda, solved.lambda) << "it ends solves earlier";
  Recorder recorder(at("r.h5"), {RecordWhen::always, 1000, {}});
  recorder.take(solver, batch.view(), solved.view());
  EXPECT_EQ(read_batch(at("r.h5")).solve->absolute_tolerance, 1e-2);
  expect_replays<double>(at("r.h5"));
}

TEST_F(RecorderTest, LimitsOfTheirOwnAreRecordedWithEnvironments) {
  auto arrays = ragged_batch(2, 5).arrays();
  for (std::size_t env = 0; env + 1 < arrays.env_row_offsets.size(); ++env) {
    arrays.env_tolerance.push_back(env % 3 == 0 ? 1e-2 : -1.0);
    arrays.env_max_iterations.push_back(env % 2 == 0 ? 5 : -1);
  }
  const auto limited = ContactBatch<double>::from_arrays(Law::coulomb, std::move(arrays));
  const ContactBatch<double> plain = ragged_batch(1, 6);
  const Solver solver(Device::cpu(), options(SolverKind::npgs, 1e-5, 40));
  Solved<double> first(solver, limited.view()), second(solver, plain.view());
  Recorder recorder(at("r.h5"), {RecordWhen::always, 1000, {}});
  recorder.take(solver, limited.view(), first.view());
  recorder.take(solver, plain.view(), second.view());
  const Recording file = read_batch(at("r.h5"));
  EXPECT_EQ(file.batch.arrays().env_max_iterations[2], 5);
  EXPECT_LT(file.batch.arrays().env_max_iterations.back(), 0) << "environments without limits of their own have none";
  expect_replays<double>(at("r.h5"));
}

TEST_F(RecorderTest, OnlyWhatFailedIsRecordedAndOnlyUnderTheMask) {
  const ContactBatch<double> batch = ragged_batch(4, 3);
  const Solver solver(Device::cpu(), options(SolverKind::npgs, 1e-8, 12));
  Solved<double> solved(solver, batch.view());
  std::vector<std::string> expected, masked;
  std::vector<bool> mask;
  for (std::size_t env = 0; env < solved.status.size(); ++env) {
    mask.push_back(env % 2 == 0);
    if (solved.status[env].code == EnvCode::solved) continue;
    expected.push_back("environment " + std::to_string(env));
    if (env % 2 == 0) masked.push_back(expected.back());
  }
  ASSERT_GT(masked.size(), 1U);
  ASSERT_LT(masked.size(), expected.size());
  ASSERT_LT(expected.size(), solved.status.size());
  Recorder failed(at("f.h5")), chosen(at("m.h5"), {RecordWhen::failed, 1000, mask});
  failed.take(solver, batch.view(), solved.view());
  chosen.take(solver, batch.view(), solved.view());
  EXPECT_EQ(read_batch(at("f.h5")).env_name, expected);
  EXPECT_EQ(read_batch(at("m.h5")).env_name, masked);
  expect_replays<double>(at("f.h5"));
  expect_replays<double>(at("m.h5"));
}

TEST_F(RecorderTest, WhereNothingFailedThereIsNoFile) {
  const ContactBatch<double> batch = ragged_batch(1, 3);
  const Solver solver(Device::cpu(), options(SolverKind::npgs, 1e30, 50));
  Solved<double> solved(solver, batch.view());
  Recorder recorder(at("f.h5"));
  EXPECT_EQ(recorder.take(solver, batch.view(), solved.view()), 0);
  EXPECT_FALSE(std::filesystem::exists(at("f.h5")));
}

TEST_F(RecorderTest, SolvesAddUpToABoundedFileThatSaysWhatItLeftOut) {
  const Solver solver(Device::cpu(), options(SolverKind::pgs, 0, 5));
  const ContactBatch<double> first = ragged_batch(1, 3), second = ragged_batch(1, 9);
  Recorder recorder(at("r.h5"), {RecordWhen::always, first.env_count() + 2, {}});
  Solved<double> a(solver, first.view());
  EXPECT_EQ(recorder.take(solver, first.view(), a.view()), first.env_count());
  const std::vector<double> warm(static_cast<std::size_t>(second.row_count()), 0.25);
  Solved<double> b(solver, second.view(), warm.data());
  EXPECT_EQ(recorder.take(solver, second.view(), b.view(), warm.data()), 2);
  EXPECT_EQ(recorder.take(solver, second.view(), b.view(), warm.data()), 0);
  EXPECT_EQ(recorder.left_out(), 2 * second.env_count() - 2);
  EXPECT_EQ(recorder.recorded(), first.env_count() + 2);
  const Recording file = read_batch(at("r.h5"));
  EXPECT_EQ(file.batch.env_count(), recorder.recorded());
  EXPECT_EQ(file.solve->left_out, recorder.left_out());
  EXPECT_EQ(file.step.front(), 1);
  EXPECT_EQ(file.step.back(), 2);
  EXPECT_EQ(file.env_name.back(), "environment 1");
  expect_replays<double>(at("r.h5"));
}

TEST_F(RecorderTest, BrokenNumbersAndFlagsReplayToo) {
  ContactBatch<float> batch = convert<float>(ragged_batch(2, 4));
  auto arrays = batch.arrays();
  arrays.b[0] = std::numeric_limits<float>::quiet_NaN();
  arrays.env_flags.assign(static_cast<std::size_t>(batch.env_count()), 0);
  arrays.env_flags[3] = kFlagBadMass;
  batch = ContactBatch<float>::from_arrays(batch.law(), std::move(arrays));
  SolverOptions o = options(SolverKind::npgs, 1e-3, 30);
  o.invalid = InvalidPolicy::isolate;
  const Solver solver(Device::cpu(), o);
  Solved<float> solved(solver, batch.view());
  ASSERT_EQ(solved.status[0].code, EnvCode::invalid_input);
  Recorder recorder(at("r.h5"), {RecordWhen::always, 1000, {}});
  recorder.take(solver, batch.view(), solved.view());
  EXPECT_EQ(read_batch(at("r.h5")).batch.arrays().env_flags[3], kFlagBadMass);
  expect_replays<float>(at("r.h5"));
}

TEST_F(RecorderTest, IslandsSolvedApartReplayApart) {
  ContactBatch<double> batch = ragged_batch(1, 5);
  batch.add(scenes::merge({scenes::make("stack", 1, 0, 2).system, scenes::make("stack", 1, 1, 3).system}, 1).system);
  SolverOptions o = options(SolverKind::npgs, 1e-5, 13);
  const Solver together(Device::cpu(), o);
  o.islands = IslandMode::apart;
  const Solver apart(Device::cpu(), o);
  Solved<double> solved(apart, batch.view()), before(together, batch.view());
  Recorder recorder(at("r.h5"), {RecordWhen::always, 1000, {}}), old(at("o.h5"), {RecordWhen::always, 1000, {}});
  recorder.take(apart, batch.view(), solved.view());
  old.take(together, batch.view(), before.view());
  EXPECT_EQ(read_batch(at("r.h5")).solve->islands, IslandMode::apart);
  expect_replays<double>(at("r.h5"));
  EXPECT_NE(before.lambda, solved.lambda) << "the mode matters here";
  message_of(ErrorCode::invalid_argument, [&] { recorder.take(together, batch.view(), before.view()); });
  // If the file holds nothing, as old files do, islands were together.
  EXPECT_EQ(bytes_of(at("o.h5")).find("islands"), std::string::npos);
  expect_replays<double>(at("o.h5"));
  Spoiler(at("r.h5")).remove("solve/islands");
  EXPECT_EQ(read_batch(at("r.h5")).solve->islands, IslandMode::together);
  const char adrift[] = "adrift";
  {
    const hid_t text = H5Tcopy(H5T_C_S1);
    H5Tset_size(text, sizeof(adrift));
    Spoiler(at("r.h5")).put("solve/islands", text, {1}, adrift);
    H5Tclose(text);
  }
  const std::string said = message_of(ErrorCode::bad_file, [&] { read_batch(at("r.h5")); });
  EXPECT_NE(said.find("adrift"), std::string::npos) << said;
}

TEST_F(RecorderTest, DeviceMemoryIsFetched) {
  const ContactBatch<float> batch = convert<float>(ragged_batch(2, 5));
  ContactBatchView<float> there = batch.view();
  there.space = MemorySpace::cuda;
  const SolverOptions o = options(SolverKind::npgs, 1e-6, 10);
  const Solver solver(Device::emulated(), o, Capacity::of(batch.view()));
  std::vector<float> lambda(static_cast<std::size_t>(batch.row_count()));
  std::vector<EnvStatus> status(static_cast<std::size_t>(batch.env_count()));
  const SolutionView<float> view{lambda.data(), nullptr, status.data()};
  solver.solve(there, view);
  Recorder recorder(at("r.h5"));
  EXPECT_GT(recorder.take(solver, there, view), 0) << "waits for the solve, which was only queued";
  expect_replays<float>(at("r.h5"));
  const ContactBatch<float> copy = solver.to_host(there);
  expect_same_bits(copy.arrays().A, batch.arrays().A, "A");
  expect_same_bits(copy.arrays().column, batch.arrays().column, "columns");
  EXPECT_EQ(copy.arrays().row_offsets, batch.arrays().row_offsets);
  EXPECT_EQ(copy.arrays().cone_row_offsets, batch.arrays().cone_row_offsets);
  EXPECT_EQ(copy.arrays().cone_group, batch.arrays().cone_group);
}

TEST_F(RecorderTest, PaddedArraysArePacked) {
  PaddedLayout<double> layout(MatrixRows::by_room);
  const std::vector<Environment<double>::Cone> one{{ConeKind::unilateral, 1, -1}}, two(2, one[0]);
  layout.add(4, one);
  layout.add(4, two);
  std::vector<double> A(32, 9.0), b(8, -1.0), R(8, 0.0), zero(8, 0.0);
  A[0] = 2;
  for (const auto& [at_entry, value] : {std::pair(16, 4.0), std::pair(17, 1.0), std::pair(20, 1.0), std::pair(21, 3.0)})
    A[static_cast<std::size_t>(at_entry)] = value;
  PaddedNumbers<double> numbers;
  numbers.A = A.data();
  numbers.b = b.data();
  numbers.R = R.data();
  numbers.mu = numbers.lo = numbers.hi = zero.data();
  const auto view = layout.view(numbers, Law::convex);
  const Solver solver(Device::cpu(), options(SolverKind::pgs, 1e-12, 200));
  Solved<double> solved(solver, view);
  Recorder recorder(at("r.h5"), {RecordWhen::always, 10, {}});
  recorder.take(solver, view, solved.view());
  const Recording file = read_batch(at("r.h5"));
  EXPECT_EQ(file.batch.arrays().env_row_offsets, (std::vector<Offset>{0, 1, 3}));
  ASSERT_EQ(file.batch.row_count(), 3);
  // 2 x = 1; and 4 y + z = 1, y + 3 z = 1.
  EXPECT_NEAR(file.solve->lambda[0], 0.5, 1e-9);
  EXPECT_NEAR(file.solve->lambda[1], 2.0 / 11, 1e-9);
  EXPECT_NEAR(file.solve->lambda[2], 3.0 / 11, 1e-9);
  expect_replays<double>(at("r.h5"));
}

TEST_F(RecorderTest, WhatDoesNotBelongTogetherIsRefused) {
  const ContactBatch<double> batch = ragged_batch(1, 3);
  const Solver solver(Device::cpu(), options(SolverKind::npgs, 0, 5)),
      other(Device::cpu(), options(SolverKind::npgs, 0, 6));
  Solved<double> solved(solver, batch.view());
  Recorder recorder(at("r.h5"), {RecordWhen::always, 1000, {}});
  recorder.take(solver, batch.view(), solved.view());
  const std::string before = bytes_of(at("r.h5"));
  EXPECT_NE(
      message_of(ErrorCode::invalid_argument, [&] { recorder.take(other, batch.view(), solved.view()); }).find("r.h5"),
      std::string::npos);
  EXPECT_EQ(bytes_of(at("r.h5")), before);
  Recorder short_mask(at("m.h5"), {RecordWhen::always, 1000, {true}});
  message_of(ErrorCode::invalid_argument, [&] { short_mask.take(solver, batch.view(), solved.view()); });
  message_of(ErrorCode::invalid_argument, [&] { Recorder(at("m.h5"), {RecordWhen::always, 0, {}}); });
  Recording bad;
  bad.batch = batch;
  bad.solve.emplace();
  message_of(ErrorCode::invalid_argument, [&] { write_batch(at("b.h5"), bad); });
}

/// Two environments of J and M, of unlike sizes, and npgs' answer in three iterations.
template <class Real>
struct Hinged {
  explicit Hinged(MassForm form = MassForm::matrix, Index block = 0) : batch(Law::coulomb, form, block) {
    for (const Index contacts : {2, 1}) {
      JacobianEnvironment<Real> env;
      const Index rows = 3 * contacts, dofs = 3 * contacts + 3, width = block == 0 ? dofs : block;
      for (Index i = 0; i < contacts; ++i) env.cones.push_back({ConeKind::friction, 3, -1});
      for (Index i = 0; i < rows * dofs; ++i) env.J.push_back(static_cast<Real>((i * 7 + 3) % 11 - 5) / Real(4));
      for (Index i = 0; i < dofs; ++i)
        for (Index j = 0; j < width; ++j)
          env.M.push_back(i % width == j ? Real(2 + i) : i % width > j ? Real(0.25) : Real(9));
      for (Index i = 0; i < dofs; ++i) env.v_free.push_back(Real(-1) + static_cast<Real>(i) / Real(3));
      for (Index i = 0; i < rows; ++i) env.target.push_back(static_cast<Real>(i) / Real(8));
      env.R.assign(static_cast<std::size_t>(rows), Real(0.125));
      env.mu.assign(static_cast<std::size_t>(rows), Real(0.5));
      batch.add(env);
    }
    found = stiction::solve(batch, solver_options());
  }
  static SolverOptions solver_options() { return options(SolverKind::npgs, 0, 3); }
  SolutionView<Real> view() { return {found.contact.lambda.data(), nullptr, found.contact.status.data()}; }

  JacobianBatch<Real> batch;
  JacobianSolution<Real> found;
};

template <class Real>
void expect_replays_from_jacobians(const std::filesystem::path& path) {
  const Recording file = read_batch(path);
  ASSERT_EQ(file.solve->form, RecordedForm::jacobian);
  const auto again = stiction::solve(jacobian_batch<Real>(file), Hinged<Real>::solver_options());
  const std::vector<Real> then(file.solve->lambda.begin(), file.solve->lambda.end());
  expect_same_bits(again.contact.lambda, then, "lambda");
}

TEST_F(RecorderTest, JacobiansAreRecordedAndSolvedAgainFromThem) {
  for (const Index block : {0, 1, 3}) {
    Hinged<double> wide(MassForm::matrix, block);
    Hinged<float> narrow(MassForm::matrix, block);
    const Solver solver(Device::cpu(), Hinged<double>::solver_options());
    Recorder recorder(at("wide.h5"), {RecordWhen::always, 3, {}}), other(at("narrow.h5"), {RecordWhen::failed, 9, {}});
    EXPECT_EQ(recorder.take(solver, wide.batch.view(), wide.view()), 2);
    EXPECT_EQ(recorder.take(solver, wide.batch.view(), wide.view()), 1);
    EXPECT_EQ(recorder.left_out(), 1);
    EXPECT_EQ(other.take(solver, narrow.batch.view(), narrow.view()), 2);
    expect_replays_from_jacobians<double>(at("wide.h5"));
    expect_replays_from_jacobians<float>(at("narrow.h5"));
    const Recording file = read_batch(at("wide.h5"));
    EXPECT_EQ(file.env_dof_offsets, (std::vector<Offset>{0, 9, 15, 24}));
    EXPECT_EQ(file.row_target[7], 0.125);
    EXPECT_EQ(file.batch.law(), Law::coulomb);
  }
}

TEST_F(RecorderTest, AFactorOfMIsMultipliedOut) {
  const Hinged<double> as_factor(MassForm::factor);
  Recording recording;
  recording.batch = assemble(as_factor.batch.view(), FactorUse::never);
  keep_dynamics(recording, as_factor.batch.view());
  // L has 2 + i on its diagonal and 0.25 below it, whatever stands above.
  EXPECT_EQ(recording.M.val[0], 4.0);
  EXPECT_EQ(recording.M.val[1], 2.0 * 0.25);
  EXPECT_EQ(recording.M.val[10], 9.0 + 0.0625);
  write_batch(at("b.h5"), recording);
  const auto again = stiction::solve(jacobian_batch<double>(read_batch(at("b.h5"))), Hinged<double>::solver_options());
  for (std::size_t i = 0; i < again.contact.lambda.size(); ++i)
    EXPECT_NEAR(again.contact.lambda[i], as_factor.found.contact.lambda[i], 1e-12);
}

TEST_F(RecorderTest, ChosenEnvironmentsKeepTheirJacobians) {
  const Hinged<double> hinged;
  Recording recording;
  const std::vector<Offset> second{1};
  keep_dynamics(recording, hinged.batch.view(), std::span<const Offset>(second));
  EXPECT_EQ(recording.env_dof_offsets, (std::vector<Offset>{0, 6}));
  EXPECT_EQ(recording.J.ptr, (std::vector<Offset>{0, 6, 12, 18}));
  EXPECT_EQ(recording.J.val[0], (3 % 11 - 5) / 4.0);
  const std::vector<Offset> none{2};
  message_of(ErrorCode::invalid_argument,
             [&] { keep_dynamics(recording, hinged.batch.view(), std::span<const Offset>(none)); });
  auto view = hinged.batch.view();
  view.space = MemorySpace::cuda;
  message_of(ErrorCode::invalid_argument, [&] { keep_dynamics(recording, view); });
}

TEST_F(RecorderTest, FormsAreNotMixedAndReadAgain) {
  Hinged<double> hinged;
  const Solver solver(Device::cpu(), Hinged<double>::solver_options());
  Recorder recorder(at("r.h5"), {RecordWhen::always, 9, {}});
  const double* const cold = nullptr;
  recorder.take(solver, hinged.batch.view(), hinged.view(), cold, RecordedForm::bodies);
  EXPECT_EQ(read_batch(at("r.h5")).solve->form, RecordedForm::bodies);
  const std::string before = bytes_of(at("r.h5"));
  message_of(ErrorCode::invalid_argument, [&] { recorder.take(solver, hinged.batch.view(), hinged.view()); });
  const ContactBatch<double> contacts = assemble(hinged.batch.view(), FactorUse::never);
  message_of(ErrorCode::invalid_argument, [&] { recorder.take(solver, contacts.view(), hinged.view()); });
  EXPECT_EQ(bytes_of(at("r.h5")), before);
}

}  // namespace
}  // namespace stiction::io::test
