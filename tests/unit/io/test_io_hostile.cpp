#include <gmock/gmock.h>
#include <sys/resource.h>

#include <optional>
#include <random>

#include "core/io/guard/inflated_size.hpp"
#include "core/io/readers.hpp"
#include "tests/unit/io/test_io_support.hpp"

// Damaged files: whatever the damage, a read ends in a result or in an Error, and takes no absurd amount of memory.
namespace stiction::io::test {
namespace {

using ::testing::HasSubstr;

class IoHostile : public Folder {};

enum class Outcome { read, refused };

/// Reads `bytes` as a file in memory. Anything but a result or an Error(bad_file) fails the test.
template <class Read>
Outcome outcome_of(const std::string& bytes, Read read) {
  try {
    read(InputFile(std::as_bytes(std::span(bytes)), "image"));
    return Outcome::read;
  } catch (const Error& error) {
    EXPECT_EQ(static_cast<int>(error.code()), static_cast<int>(ErrorCode::bad_file)) << error.what();
    return Outcome::refused;
  }
}

/// Uses a batch as a caller does next, so that arrays that do not fit one another are noticed.
void read_and_use(const InputFile& file) {
  const Recording recording = read_any(file);
  if (validate(recording.batch.view()).empty()) asymmetry(recording.batch.view());
}

struct Count {
  int read = 0, refused = 0;
};

/// Damages one to four bytes at a time: a flipped bit, a random byte, or 0x00 or 0xff.
template <class Read>
Count flip_bytes(const std::string& bytes, std::uint64_t seed, int trials, Read read) {
  std::mt19937_64 random(seed);
  Count count;
  for (int trial = 0; trial < trials; ++trial) {
    std::string damaged = bytes;
    const std::uint64_t flips = 1 + random() % 4;
    for (std::uint64_t flip = 0; flip < flips; ++flip) {
      char& byte = damaged[random() % damaged.size()];
      const std::uint64_t kind = random() % 3, value = random();
      if (kind == 0) byte = static_cast<char>(byte ^ (1 << (value % 8)));
      if (kind == 1) byte = static_cast<char>(value);
      if (kind == 2) byte = static_cast<char>(value % 2 == 0 ? 0x00 : 0xff);
    }
    ++(outcome_of(damaged, read) == Outcome::read ? count.read : count.refused);
  }
  return count;
}

std::uint64_t peak_memory_mib() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) / 1024;
}

TEST_F(IoHostile, TruncatedFilesAreRefused) {
  write_batch(at("a.h5"), long_recording(1000));
  const std::string bytes = bytes_of(at("a.h5"));
  int lengths = 0;
  for (std::size_t length = 0; length < bytes.size(); length += length < 256 ? 1 : 97) {
    EXPECT_EQ(outcome_of(bytes.substr(0, length), read_any), Outcome::refused) << "of length " << length;
    ++lengths;
  }
  EXPECT_GT(lengths, 500);
  EXPECT_EQ(outcome_of(bytes.substr(0, bytes.size() - 1), read_any), Outcome::refused);
  EXPECT_EQ(outcome_of(bytes, read_any), Outcome::read);
}

TEST_F(IoHostile, TruncatedFilesOnDiskAreCalledSo) {
  write_batch(at("a.h5"), long_recording(1000));
  const std::string bytes = bytes_of(at("a.h5"));
  for (const std::size_t length : {bytes.size() / 4, bytes.size() / 2, bytes.size() - 1}) {
    write_bytes(at("b.h5"), bytes.substr(0, length));
    EXPECT_THAT(message_of(ErrorCode::bad_file, [&] { read_batch(at("b.h5")); }),
                HasSubstr("b.h5: the HDF5 file is truncated or damaged"));
  }
}

TEST_F(IoHostile, FlippedBytesInABatchNeverCrashTheReader) {
  write_batch(at("a.h5"), small_recording());
  const Count count = flip_bytes(bytes_of(at("a.h5")), 1, 2500, read_and_use);
  EXPECT_GT(count.refused, 100) << "the flips hit nothing that is looked at";
  EXPECT_GT(count.read, 100) << "the flips leave nothing readable";
  EXPECT_LT(peak_memory_mib(), 512U);
}

TEST_F(IoHostile, FlippedBytesInPackedDatasetsNeverCrashTheReader) {
  write_batch(at("a.h5"), long_recording(400));
  const Count count = flip_bytes(bytes_of(at("a.h5")), 2, 2000, read_and_use);
  EXPECT_GT(count.refused, 100);
  EXPECT_GT(count.read, 10);
  EXPECT_LT(peak_memory_mib(), 512U);
}

TEST_F(IoHostile, FlippedBytesInAnFclibProblemNeverCrashTheReader) {
  write_fclib_local(at("a.h5"), long_recording(20), 0);
  const Count count = flip_bytes(bytes_of(at("a.h5")), 3, 2000, read_and_use);
  EXPECT_GT(count.refused, 100);
  EXPECT_GT(count.read, 10);
  EXPECT_LT(peak_memory_mib(), 512U);
}

TEST_F(IoHostile, FlippedBytesInASolutionNeverCrashTheReader) {
  SolutionFile solution;
  solution.lambda.assign(2000, 0.5);
  solution.env_row_offsets = {0, 2000};
  solution.status.assign(1, EnvStatus{});
  write_solution(at("s.h5"), solution);
  const Count count =
      flip_bytes(bytes_of(at("s.h5")), 4, 2000, [](const InputFile& file) { return read_solution(file); });
  EXPECT_GT(count.refused, 100);
  EXPECT_GT(count.read, 10);
  EXPECT_LT(peak_memory_mib(), 512U);
}

TEST_F(IoHostile, ADamagedStringIsRefusedAndNotFollowed) {
  write_batch(at("a.h5"), small_recording());
  std::string bytes = bytes_of(at("a.h5"));
  const std::size_t heap = bytes.find("GCOL");
  ASSERT_NE(heap, std::string::npos) << "no strings of variable length in the file";
  bytes[heap] = 'X';
  EXPECT_THAT(message_of(ErrorCode::bad_file, [&] { read_any(InputFile(std::as_bytes(std::span(bytes)), "image")); }),
              HasSubstr("image: attribute 'format' is a damaged string"));
}

/// Places of the layout messages of packed datasets: version 3, chunked, two chunk dimensions (elements and bytes).
std::vector<std::size_t> chunked_layouts(const std::string& bytes) {
  std::vector<std::size_t> places;
  const std::string message("\x08\x00\x18\x00\x00\x00\x00\x00\x03\x02\x02", 11);
  for (std::size_t at = bytes.find(message); at != std::string::npos; at = bytes.find(message, at + 1)) {
    places.push_back(at + 8);
  }
  return places;
}

TEST_F(IoHostile, ChunkSizesThatHdf5WouldDivideByAreRefused) {
  write_batch(at("a.h5"), long_recording(400));
  const std::string bytes = bytes_of(at("a.h5"));
  const std::vector<std::size_t> places = chunked_layouts(bytes);
  ASSERT_GE(places.size(), 5U) << "A/ptr, A/col, A/val, b and R are packed";
  for (const std::size_t place : places) {
    std::string no_dimensions = bytes, no_elements = bytes;
    no_dimensions[place + 2] = 0;
    for (std::size_t i = 0; i < 4; ++i) no_elements[place + 11 + i] = 0;
    EXPECT_THAT(
        message_of(ErrorCode::bad_file, [&] { read_any(InputFile(std::as_bytes(std::span(no_dimensions)), "image")); }),
        HasSubstr("has chunks of another rank than its shape"));
    EXPECT_THAT(
        message_of(ErrorCode::bad_file, [&] { read_any(InputFile(std::as_bytes(std::span(no_elements)), "image")); }),
        HasSubstr("has chunks of size zero"));
  }
}

/// Returns the beginnings of zlib streams of the level that the writer uses.
std::vector<std::size_t> packed_chunks(const std::string& bytes) {
  std::vector<std::size_t> places;
  for (std::size_t at = bytes.find("\x78\x5e"); at != std::string::npos; at = bytes.find("\x78\x5e", at + 1)) {
    places.push_back(at);
  }
  return places;
}

// HDF5 itself copies as many bytes as the chunk should have, whatever it unpacked to.
TEST_F(IoHostile, AChunkThatUnpacksToLessThanItsElementsIsRefused) {
  write_batch(at("a.h5"), long_recording(400));
  const std::string bytes = bytes_of(at("a.h5"));
  const std::vector<std::size_t> places = packed_chunks(bytes);
  ASSERT_GE(places.size(), 5U) << "A/ptr, A/col, A/val, b and R are packed";
  const std::string nothing("\x78\x5e\x03\x00\x00\x00\x00\x01", 8);
  for (const std::size_t place : places) {
    std::string emptied = bytes;
    emptied.replace(place, nothing.size(), nothing);
    EXPECT_THAT(
        message_of(ErrorCode::bad_file, [&] { read_any(InputFile(std::as_bytes(std::span(emptied)), "image")); }),
        HasSubstr("has a damaged chunk that begins at element 0"));
  }
}

std::optional<std::uint64_t> size_of(const std::string& stream, std::uint64_t limit = 1000) {
  return inflated_size(std::span<const char>(stream), limit);
}

TEST(InflatedSize, CountsWhatABlockUnpacksTo) {
  const std::string stored(
      "\x78\x01\x01\x03\x00\xfc\xff"
      "abc",
      10);
  const std::string repeated("\x78\x9c\x4b\x4c\xc4\x04\x00", 7);  // zlib.compress(b"a" * 20), fixed codes
  EXPECT_EQ(size_of(stored), 3U);
  EXPECT_EQ(size_of(repeated), 20U);
  EXPECT_EQ(size_of(repeated, 20), 20U);
  EXPECT_EQ(size_of(repeated, 19), std::nullopt) << "more than the limit";
  for (const std::string& stream : {stored, repeated}) {
    for (std::size_t length = 0; length < stream.size() - 1; ++length) {
      EXPECT_EQ(size_of(stream.substr(0, length)), std::nullopt) << length << " of " << stream.size() << " bytes";
    }
  }
  EXPECT_EQ(size_of(std::string("\x79\x9c\x4b\x4c\x44\x05\x00", 7)), std::nullopt) << "another method";
  EXPECT_EQ(size_of(std::string("\x78\x9c\x07\x00", 4)), std::nullopt) << "a kind of block that there is not";
}

}  // namespace
}  // namespace stiction::io::test
