// Checkpoints of worlds on disk.
#include <gmock/gmock.h>

#include "tests/unit/io/test_io_support.hpp"

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

/// Two environments of three bodies, and their parts of two bodies and one. Contact 64 is of bodies of both parts.
struct InParts {
  CheckpointFile whole, first, second;
  CheckpointParts parts;
};

CheckpointFile of_bodies(const std::vector<double>& bodies, const std::vector<Offset>& offsets,
                         const std::vector<std::uint64_t>& ids) {
  CheckpointFile file;
  file.run = "scene=pile";
  file.step = 7;
  const auto put = [&](std::size_t width, std::vector<double>& to) {
    for (const double body : bodies)
      for (std::size_t k = 0; k < width; ++k) to.push_back(100 * body + static_cast<double>(10 * width + k));
  };
  put(3, file.world.position);
  put(4, file.world.orientation);
  put(6, file.world.twist);
  put(6, file.world.wrench);
  file.world.contact_offsets = offsets;
  file.world.contact_id = ids;
  for (const std::uint64_t id : ids)
    for (int k = 0; k < 3; ++k) file.world.impulse.push_back(static_cast<double>(id) + 0.25 * k);
  return file;
}

InParts in_parts() {
  return {of_bodies({0, 1, 2, 10, 11, 12}, {0, 3, 4}, {3, 64, 130, 5}),
          of_bodies({0, 1, 10, 11}, {0, 2, 3}, {3, 64, 5}),
          of_bodies({2, 12}, {0, 2, 2}, {64, 130}),
          {"scene=pile", 7, {0, 2, 3}, {}}};
}

void write(const std::filesystem::path& path, InParts& all) {
  all.parts.checksums = {write_checkpoint_part(checkpoint_part(path, 7, 0, 2), all.first),
                         write_checkpoint_part(checkpoint_part(path, 7, 1, 2), all.second)};
  write_checkpoint_parts(path, all.parts);
}

TEST_F(IoCheckpoint, PartsAreReadAsOne) {
  InParts all = in_parts();
  write(at("c.h5"), all);
  expect_same(read_checkpoint(at("c.h5")), all.whole);
}

TEST_F(IoCheckpoint, SomeBodiesAreReadFromTheirParts) {
  InParts all = in_parts();
  write(at("c.h5"), all);
  const CheckpointShare last = read_checkpoint(at("c.h5"), 2, {2, 3});
  EXPECT_EQ(last.bodies.first, 2);
  EXPECT_EQ(last.bodies.end, 3);
  expect_same(last.file, all.second);
  // From one file, too, with all its contacts.
  write_checkpoint(at("one.h5"), all.whole);
  CheckpointFile middle = of_bodies({1, 2, 11, 12}, {0, 3, 4}, {3, 64, 130, 5});
  expect_same(read_checkpoint(at("one.h5"), 2, {1, 3}).file, middle);
  expect_same(read_checkpoint(at("c.h5"), 2, {1, 3}).file, middle);
  EXPECT_EQ(read_checkpoint(at("c.h5"), 2, {1, 9}).bodies.end, 3);
  // The part that is not needed may be gone.
  std::filesystem::remove(checkpoint_part(at("c.h5"), 7, 0, 2));
  expect_same(read_checkpoint(at("c.h5"), 2, {2, 3}).file, all.second);
  EXPECT_THAT(message_of(ErrorCode::bad_file, [&] { static_cast<void>(read_checkpoint(at("c.h5"))); }),
              HasSubstr("names c.h5.step7.part0of2, which is not there"));
}

TEST_F(IoCheckpoint, TheHeadIsReadAlone) {
  InParts all = in_parts();
  write(at("c.h5"), all);
  write_checkpoint(at("one.h5"), all.whole);
  std::filesystem::remove(checkpoint_part(at("c.h5"), 7, 0, 2));
  for (const char* name : {"c.h5", "one.h5"}) {
    const CheckpointHead head = read_checkpoint_head(at(name));
    EXPECT_EQ(head.run, "scene=pile");
    EXPECT_EQ(head.step, 7);
  }
}

TEST_F(IoCheckpoint, AnotherNumberOfEnvironmentsIsNamed) {
  InParts all = in_parts();
  write(at("c.h5"), all);
  write_checkpoint(at("one.h5"), all.whole);
  for (const char* name : {"c.h5", "one.h5"})
    for (const Offset asked : {0, 1, 3, 6})
      EXPECT_THAT(message_of(ErrorCode::bad_file, [&] { static_cast<void>(read_checkpoint(at(name), asked, {0, 2})); }),
                  HasSubstr("number of environments is 2, and " + std::to_string(asked) + " is asked for: ask for 2"))
          << name;
}

TEST_F(IoCheckpoint, PartsOfAnotherCheckpointAreRefused) {
  InParts all = in_parts();
  write(at("c.h5"), all);
  all.second.world.twist[3] += 1;
  write_checkpoint_part(checkpoint_part(at("c.h5"), 7, 1, 2), all.second);
  EXPECT_THAT(message_of(ErrorCode::bad_file, [&] { static_cast<void>(read_checkpoint(at("c.h5"))); }),
              HasSubstr("part1of2, which is of another checkpoint"));
  all.parts.body_offsets = {0, 1, 3};
  write(at("c.h5"), all);
  EXPECT_THAT(message_of(ErrorCode::bad_file, [&] { static_cast<void>(read_checkpoint(at("c.h5"))); }),
              HasSubstr("'position' has 12 elements, expected 6"));
}

TEST_F(IoCheckpoint, PartsThatNothingNamesAreRemoved) {
  InParts all = in_parts();
  write(at("c.h5"), all);
  const auto files = [&] {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(at(""))) names.push_back(entry.path().filename());
    std::sort(names.begin(), names.end());
    return names;
  };
  write_checkpoint_part(checkpoint_part(at("c.h5"), 8, 0, 3), all.first);
  std::ofstream(at("c.h5.step8.partition")) << "not ours";
  std::ofstream(at("c.h5.stepless.part0of2")) << "not ours";
  EXPECT_EQ(files().size(), 6U);
  write(at("c.h5"), all);
  EXPECT_THAT(files(), ::testing::ElementsAre("c.h5", "c.h5.step7.part0of2", "c.h5.step7.part1of2",
                                              "c.h5.step8.partition", "c.h5.stepless.part0of2"));
  write_checkpoint(at("c.h5"), all.whole);
  EXPECT_THAT(files(), ::testing::ElementsAre("c.h5", "c.h5.step8.partition", "c.h5.stepless.part0of2"));
}

}  // namespace
}  // namespace stiction::io::test
