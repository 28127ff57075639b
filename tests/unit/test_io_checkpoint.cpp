// Checkpoints of worlds on disk.
#include <gmock/gmock.h>

#include "tests/unit/test_io_support.hpp"

namespace stiction::io::test {
namespace {

using ::testing::HasSubstr;

class IoCheckpoint : public Folder {};

CheckpointFile sample(Precision precision) {
  CheckpointFile file;
  file.precision = precision;
  file.run = "scene=pile seed=3";
  file.step = 120;
  file.world.position = {0.5, -0.0, static_cast<double>(0.1F)};
  file.world.orientation = {1, 0, 0, std::numeric_limits<double>::quiet_NaN()};
  file.world.twist = {1, 2, 3, 4, 5, std::numeric_limits<double>::infinity()};
  file.world.wrench = {0, 0, 0, 0, 0, 0.25};
  file.world.contact_offsets = {0, 2, 2, 3};
  file.world.contact_id = {64, 65, 0xfedcba9876543210U};
  file.world.impulse = {1, 2, 3, 4, 5, 6, 7, 8, 9};
  return file;
}

void expect_same(const CheckpointFile& a, const CheckpointFile& b) {
  EXPECT_EQ(a.precision, b.precision);
  EXPECT_EQ(a.run, b.run);
  EXPECT_EQ(a.step, b.step);
  expect_same_bits(a.world.position, b.world.position, "position");
  expect_same_bits(a.world.orientation, b.world.orientation, "orientation");
  expect_same_bits(a.world.twist, b.world.twist, "twist");
  expect_same_bits(a.world.wrench, b.world.wrench, "wrench");
  expect_same_bits(a.world.contact_offsets, b.world.contact_offsets, "contact_offsets");
  expect_same_bits(a.world.contact_id, b.world.contact_id, "contact_id");
  expect_same_bits(a.world.impulse, b.world.impulse, "impulse");
}

TEST_F(IoCheckpoint, ComesBackBitForBitInBothPrecisions) {
  for (const Precision precision : {Precision::f32, Precision::f64}) {
    write_checkpoint(at("c.h5"), sample(precision));
    expect_same(read_checkpoint(at("c.h5")), sample(precision));
  }
}

TEST_F(IoCheckpoint, OfNothingComesBack) {
  CheckpointFile empty;
  empty.world.contact_offsets = {0};
  write_checkpoint(at("c.h5"), empty);
  expect_same(read_checkpoint(at("c.h5")), empty);
}

TEST_F(IoCheckpoint, ReplacesTheOneBeforeAndLeavesNothingBeside) {
  write_checkpoint(at("c.h5"), sample(Precision::f64));
  CheckpointFile next = sample(Precision::f64);
  next.step = 121;
  write_checkpoint(at("c.h5"), next);
  EXPECT_EQ(read_checkpoint(at("c.h5")).step, 121);
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(at(""))) files += entry.is_regular_file() ? 1 : 0;
  EXPECT_EQ(files, 1);
}

/// The message when one number of a dataset was changed after it was written.
template <class T>
std::string after_change(const std::filesystem::path& path, const char* dataset, hid_t type, T value) {
  write_checkpoint(path, sample(Precision::f64));
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  const hid_t set = H5Dopen2(file, dataset, H5P_DEFAULT);
  const hid_t space = H5Dget_space(set);
  const hsize_t first = 1;
  H5Sselect_elements(space, H5S_SELECT_SET, 1, &first);
  const hsize_t one = 1;
  const hid_t memory = H5Screate_simple(1, &one, nullptr);
  EXPECT_GE(H5Dwrite(set, type, memory, space, H5P_DEFAULT, &value), 0);
  H5Sclose(memory);
  H5Sclose(space);
  H5Dclose(set);
  H5Fclose(file);
  return message_of(ErrorCode::bad_file, [&] { read_checkpoint(path); });
}

TEST_F(IoCheckpoint, ADamagedOneIsRefused) {
  for (const char* dataset : {"position", "orientation", "twist", "wrench", "impulse"})
    EXPECT_THAT(after_change(at("c.h5"), dataset, H5T_NATIVE_DOUBLE, 0.75), HasSubstr("is damaged")) << dataset;
  EXPECT_THAT(after_change(at("c.h5"), "contact_id", H5T_NATIVE_UINT64, std::uint64_t{66}), HasSubstr("is damaged"));
  EXPECT_THAT(after_change(at("c.h5"), "contact_offsets", H5T_NATIVE_INT64, std::int64_t{1}), HasSubstr("is damaged"));
  EXPECT_THAT(after_change(at("c.h5"), "contact_offsets", H5T_NATIVE_INT64, std::int64_t{5}), HasSubstr("decreases"));
}

TEST_F(IoCheckpoint, EveryCutOfAFileIsRefused) {
  write_checkpoint(at("c.h5"), sample(Precision::f64));
  const std::string whole = bytes_of(at("c.h5"));
  for (std::size_t length = 0; length < whole.size(); length += whole.size() / 16) {
    write_bytes(at("cut.h5"), whole.substr(0, length));
    EXPECT_THAT(message_of(ErrorCode::bad_file, [&] { read_checkpoint(at("cut.h5")); }), HasSubstr("cut.h5"));
  }
}

TEST_F(IoCheckpoint, OtherFilesAreNone) {
  SolutionFile solution;
  solution.lambda = {1};
  write_solution(at("s.h5"), solution);
  EXPECT_THAT(message_of(ErrorCode::bad_file, [&] { read_checkpoint(at("s.h5")); }),
              HasSubstr("expected 'world-checkpoint'"));
}

}  // namespace
}  // namespace stiction::io::test
