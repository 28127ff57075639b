#include <gmock/gmock.h>
#include <sys/resource.h>

#include <csignal>
#include <cstdlib>

#include "tests/unit/io/test_io_support.hpp"

namespace stiction::io::test {
namespace {

using ::testing::HasSubstr;

class IoBatch : public Folder {};

TEST_F(IoBatch, EveryPartOfARecordingComesBackBitForBit) {
  const Recording recording = small_recording();
  write_batch(at("a.h5"), recording);
  EXPECT_EQ(detect(at("a.h5")), FileKind::contact_batch);
  expect_same(read_batch(at("a.h5")), recording);
}

TEST_F(IoBatch, PackedDatasetsComeBackBitForBit) {
  const Recording recording = long_recording(2000);
  write_batch(at("a.h5"), recording);
  EXPECT_LT(std::filesystem::file_size(at("a.h5")), recording.batch.arrays().A.size() * 16) << "A/col and A/val alone";
  expect_same(read_batch(at("a.h5")), recording);
}

TEST_F(IoBatch, AnEmptyBatchComesBackEmpty) {
  write_batch(at("a.h5"), Recording{});
  const Recording back = read_batch(at("a.h5"));
  EXPECT_EQ(back.batch.env_count(), 0);
  EXPECT_EQ(back.batch.row_count(), 0);
  EXPECT_TRUE(back.J.ptr.empty());
}

TEST_F(IoBatch, TheSameRecordingGivesTheSameBytes) {
  write_batch(at("a.h5"), small_recording());
  write_batch(at("b.h5"), small_recording());
  EXPECT_EQ(bytes_of(at("a.h5")), bytes_of(at("b.h5")));
}

/// The numbers of M that the batch keeps.
Offset mass_count(const Recording& recording) {
  return jacobian_batch<double>(recording).view().mass_count;
}

TEST_F(IoBatch, JAndMBecomeAJacobianBatch) {
  const Recording recording = small_recording();
  const auto batch = jacobian_batch<double>(recording);
  const auto view = batch.view();
  ASSERT_EQ(view.env_count, 2);
  EXPECT_EQ(view.law, Law::coulomb);
  EXPECT_EQ(std::vector<Index>(view.column, view.column + view.entry_count), recording.J.col);
  EXPECT_EQ(std::vector<double>(view.J, view.J + view.entry_count), recording.J.val);
  EXPECT_EQ(std::vector<double>(view.M, view.M + view.mass_count), (std::vector<double>{2.0, 0.5, 0.5, 3.0, 1.0}));
  EXPECT_EQ(std::vector<double>(view.v_free, view.v_free + 3), recording.v_free);
  EXPECT_EQ(std::vector<double>(view.target, view.target + 6), recording.row_target);
  EXPECT_EQ(std::vector<double>(view.mu, view.mu + 6), recording.batch.arrays().mu);
  const std::vector<Offset> backward{1, 0};
  const auto turned = jacobian_batch<float>(recording, backward);
  EXPECT_EQ(turned.view().env_rows(0), 1);
  EXPECT_EQ(turned.view().v_free[0], -9.81F);
  EXPECT_EQ(turned.view().J[0], 1.0F);
}

TEST_F(IoBatch, MOfBlocksIsKeptAsBlocks) {
  Recording recording = small_recording();
  EXPECT_EQ(mass_count(recording), 2 * 2 + 1) << "dense";
  recording.M = {{0, 1, 2, 3}, {0, 1, 0}, {2.0, 3.0, 1.0}};
  EXPECT_EQ(mass_count(recording), 3) << "diagonal";
}

TEST_F(IoBatch, WhatIsNoJacobianFormIsRefused) {
  const auto refusal = [](auto&& edit, std::vector<Offset> order = {}) -> std::string {
    Recording recording = small_recording();
    edit(recording);
    try {
      jacobian_batch<double>(recording, order);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::invalid_argument);
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(refusal([](Recording&) {}), "");
  EXPECT_THAT(refusal([](Recording& r) { r.J = {}; }), HasSubstr("no J and M"));
  EXPECT_THAT(refusal([](Recording& r) { r.v_free.clear(); }), HasSubstr("no J and M"));
  EXPECT_THAT(refusal([](Recording& r) { r.J.ptr.pop_back(); }), HasSubstr("J.ptr has 6 elements, expected 7"));
  EXPECT_THAT(refusal([](Recording& r) { r.M.val.pop_back(); }), HasSubstr("M.val has 4 elements, expected 5"));
  EXPECT_THAT(refusal([](Recording& r) { r.v_free.pop_back(); }), HasSubstr("v_free has 2 elements, expected 3"));
  EXPECT_THAT(refusal([](Recording& r) { r.row_target.pop_back(); }), HasSubstr("row_target has 5"));
  EXPECT_EQ(refusal([](Recording& r) { r.M.val[1] = 0.5000001; }), "") << "rounded";
  EXPECT_THAT(refusal([](Recording& r) { r.M.val[1] = 0.501; }),
              HasSubstr("M of environment 0 is not symmetric at (1, 0): solve it by its matrix A"));
  EXPECT_THAT(refusal([](Recording&) {}, {2}), HasSubstr("order names environment 2: there are 2"));
}

TEST_F(IoBatch, AMassMatrixTooLargeToBeDenseIsRefused) {
  Environment<double> environment;
  environment.cones = {{ConeKind::unilateral, 1, -1}};
  environment.set_dense(std::vector<double>{1.0}, 1);
  environment.b = {1.0};
  Recording recording;
  recording.batch.add(environment);
  const auto chain_of = [&](Offset dofs) {
    recording.env_dof_offsets = {0, dofs};
    recording.J = {{0, 1}, {0}, {1.0}};
    recording.M = {{0}, {}, {}};
    for (Offset i = 0; i < dofs; ++i) {
      for (const Offset j : {i - 1, i, i + 1}) {
        if (j < 0 || j >= dofs) continue;
        recording.M.col.push_back(static_cast<Index>(j));
        recording.M.val.push_back(i == j ? 2.0 : -0.5);
      }
      recording.M.ptr.push_back(static_cast<Offset>(recording.M.col.size()));
    }
    recording.v_free.assign(static_cast<std::size_t>(dofs), 0.0);
  };
  chain_of(100);
  EXPECT_EQ(mass_count(recording), 100 * 100);
  chain_of(8193);
  EXPECT_THROW(jacobian_batch<float>(recording), Error);
}

TEST_F(IoBatch, SymmetricBoxesAreWrittenAsTheirBoundAlone) {
  Environment<double> environment;
  environment.cones = {{ConeKind::box, 1, -1}};
  environment.set_dense(std::vector<double>{1.0}, 1);
  environment.b = {1.0};
  environment.lo = {-2.5};
  environment.hi = {2.5};
  Recording recording;
  recording.batch.add(environment);
  write_batch(at("a.h5"), recording);
  const Spoiler file(at("a.h5"));
  EXPECT_EQ(H5Lexists(file.file(), "row_lo", H5P_DEFAULT), 0);
  EXPECT_EQ(H5Lexists(file.file(), "cone_group", H5P_DEFAULT), 0);
}

TEST_F(IoBatch, ABoxWithBothBoundsPlusZeroKeepsTheirSigns) {
  Environment<double> environment;
  environment.cones = {{ConeKind::box, 1, -1}};
  environment.set_dense(std::vector<double>{1.0}, 1);
  environment.b = {1.0};
  environment.lo = {0.0};
  environment.hi = {0.0};
  Recording recording;
  recording.batch.add(environment);
  write_batch(at("a.h5"), recording);
  expect_same(read_batch(at("a.h5")), recording);
}

TEST_F(IoBatch, BoxedFrictionKeepsItsKindAndItsFriction) {
  Environment<double> environment;
  environment.cones = {{ConeKind::box_friction, 3, -1}, {ConeKind::friction, 2, -1}};
  environment.set_dense(std::vector<double>{1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1},
                        5);
  environment.b = {1, 2, 3, 4, 5};
  environment.mu = {0, 0.5, 0.25, 0, 0.75};
  Recording recording;
  recording.batch.add(environment);
  write_batch(at("a.h5"), recording);
  const Recording back = read_batch(at("a.h5"));
  EXPECT_EQ(back.batch.arrays().cone_kind, (std::vector<ConeKind>{ConeKind::box_friction, ConeKind::friction}));
  EXPECT_EQ(back.batch.arrays().mu, environment.mu);
}

TEST_F(IoBatch, ParametersThatNoConeUsesAreNotKept) {
  Environment<double> environment;
  environment.cones = {{ConeKind::unilateral, 1, -1}};
  environment.set_dense(std::vector<double>{1.0}, 1);
  environment.b = {1.0};
  environment.mu = {0.5};
  environment.lo = {-1.0};
  Recording recording;
  recording.batch.add(environment);
  write_batch(at("a.h5"), recording);
  const Recording back = read_batch(at("a.h5"));
  EXPECT_EQ(back.batch.arrays().mu, std::vector<double>{0.0});
  EXPECT_EQ(back.batch.arrays().lo, std::vector<double>{0.0});
}

TEST_F(IoBatch, NumbersOfOtherWidthsAndByteOrdersAreReadExactly) {
  write_batch(at("a.h5"), small_recording());
  {
    Spoiler file(at("a.h5"));
    const std::vector<float> R = {0.0F, 0.5F, 0.25F, 0.125F, 0.25F, 0.0F};
    file.put("R", H5T_NATIVE_FLOAT, {6}, R.data());
    const std::vector<std::uint64_t> rows = {0, 5, 6};
    file.put("env_row_ptr", H5T_NATIVE_UINT64, {3}, rows.data());
    // Big-endian 5 and 1, written as bytes of that type.
    const std::vector<std::uint8_t> cones = {0, 0, 0, 3, 0, 4};
    file.put("env_cone_ptr", H5T_STD_U16BE, {3}, cones.data());
  }
  const Recording back = read_batch(at("a.h5"));
  EXPECT_EQ(back.batch.arrays().R, (std::vector<double>{0.0, 0.5, 0.25, 0.125, 0.25, 0.0}));
  EXPECT_EQ(back.batch.arrays().env_row_offsets, (std::vector<Offset>{0, 5, 6}));
  EXPECT_EQ(back.batch.arrays().env_cone_offsets, (std::vector<Offset>{0, 3, 4}));
}

TEST_F(IoBatch, IdsOfContactsMayBeOfAnyIntegerType) {
  write_batch(at("a.h5"), small_recording());
  {
    Spoiler file(at("a.h5"));
    const std::vector<std::uint8_t> ids = {1, 255, 0, 128};
    file.put("cone_id", H5T_NATIVE_UINT8, {4}, ids.data());
  }
  EXPECT_EQ(read_batch(at("a.h5")).cone_id, (std::vector<std::uint64_t>{1, 255, 0, 128}));
  {
    Spoiler file(at("a.h5"));
    file.put("cone_id", std::vector<std::int64_t>{4, 3, 9000000000000000000, 1});
  }
  EXPECT_EQ(read_batch(at("a.h5")).cone_id, (std::vector<std::uint64_t>{4, 3, 9000000000000000000U, 1}));
}

TEST_F(IoBatch, AFileWithoutStepsAndIdsIsAsGoodAsBefore) {
  Recording recording = small_recording();
  recording.step.clear();
  recording.dt.clear();
  recording.cone_id.clear();
  write_batch(at("a.h5"), recording);
  {
    const Spoiler file(at("a.h5"));
    EXPECT_EQ(H5Lexists(file.file(), "dt", H5P_DEFAULT), 0);
    EXPECT_EQ(H5Lexists(file.file(), "cone_id", H5P_DEFAULT), 0);
  }
  expect_same(read_batch(at("a.h5")), recording);
}

TEST_F(IoBatch, FixedLengthStringsAreReadLikeOthers) {
  write_batch(at("a.h5"), small_recording());
  {
    Spoiler file(at("a.h5"));
    const hid_t type = H5Tcopy(H5T_C_S1);
    H5Tset_size(type, 4);
    file.put("env_name", type, {2}, "onetwo4");  // "onet", "wo4": no room for a terminator in the first
    H5Tclose(type);
    file.put_attribute("law", std::string("convex"));
  }
  const Recording back = read_batch(at("a.h5"));
  EXPECT_EQ(back.env_name, (std::vector<std::string>{"onet", "wo4"}));
  EXPECT_EQ(back.batch.law(), Law::convex);
}

TEST_F(IoBatch, LongAndManyNamesComeBack) {
  Recording recording;
  for (int i = 0; i < 2000; ++i) {
    recording.batch.add(Environment<double>{});
    recording.env_name.push_back("environment " + std::string(static_cast<std::size_t>(i % 97) * 50, 'x') +
                                 std::to_string(i));
  }
  write_batch(at("a.h5"), recording);
  EXPECT_EQ(read_batch(at("a.h5")).env_name, recording.env_name);
}

TEST_F(IoBatch, AFailedWriteLeavesWhatWasThere) {
  write_batch(at("a.h5"), small_recording());
  const std::string before = bytes_of(at("a.h5"));
  Recording wrong = small_recording();
  wrong.lambda_ref.pop_back();
  const std::string message = message_of(ErrorCode::invalid_argument, [&] { write_batch(at("a.h5"), wrong); });
  EXPECT_THAT(message, HasSubstr("recording.lambda_ref has 5 elements, expected 6 or none"));
  EXPECT_EQ(bytes_of(at("a.h5")), before);
  const auto entries = std::filesystem::directory_iterator(at("."));
  EXPECT_EQ(std::distance(begin(entries), end(entries)), 1) << "a temporary file was left behind";
}

TEST_F(IoBatch, PartsThatDoNotFitTheBatchAreRefused) {
  const auto refusal = [&](const std::function<void(Recording&)>& spoil) {
    Recording recording = small_recording();
    spoil(recording);
    return message_of(ErrorCode::invalid_argument, [&] { write_batch(at("a.h5"), recording); });
  };
  EXPECT_THAT(refusal([](Recording& r) { r.env_dof_offsets.clear(); }), HasSubstr("env_dof_offsets is empty"));
  EXPECT_THAT(refusal([](Recording& r) { r.J.ptr.pop_back(); }), HasSubstr("J.ptr has 6 elements"));
  EXPECT_THAT(refusal([](Recording& r) { r.M.col.pop_back(); }), HasSubstr("M has 4 columns and 5 values"));
  EXPECT_THAT(refusal([](Recording& r) { r.v_free.push_back(0.0); }), HasSubstr("v_free has 4 elements, expected 3"));
  EXPECT_THAT(refusal([](Recording& r) { r.step.pop_back(); }), HasSubstr("step has 1 elements, expected 2"));
  EXPECT_FALSE(std::filesystem::exists(at("a.h5")));
}

TEST_F(IoBatch, AFolderThatIsNotThereIsNamed) {
  const std::string message = message_of(ErrorCode::io, [&] { write_batch(at("nowhere/a.h5"), small_recording()); });
  EXPECT_THAT(message, HasSubstr("nowhere/a.h5: cannot be created: is the folder there and writable?"));
}

/// In a process of its own, for HDF5 1.10 used to crash only at its end. The most bytes of a file stand for a full
/// disk.
TEST_F(IoBatch, AFullDiskIsSaidAndTheProgramEndsByItself) {
  const Recording recording = long_recording(2000);
  write_batch(at("a.h5"), small_recording());
  const std::string before = bytes_of(at("a.h5"));
  for (const rlim_t most : {0, 100, 4096, 20000}) {
    const auto write = [&] {
      const rlimit limit{most, most};
      setrlimit(RLIMIT_FSIZE, &limit);
      std::signal(SIGXFSZ, SIG_IGN);
      const std::string message = message_of(ErrorCode::io, [&] { write_batch(at("a.h5"), recording); });
      std::exit(message == at("a.h5").string() + ": cannot be written: File too large" ? 0 : 1);
    };
    EXPECT_EXIT(write(), ::testing::ExitedWithCode(0), "") << most;
    EXPECT_EQ(bytes_of(at("a.h5")), before) << most;
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(at("")), {}), 1) << "something is left of " << most;
  }
}

}  // namespace
}  // namespace stiction::io::test
