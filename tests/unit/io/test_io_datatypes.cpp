#include <gmock/gmock.h>

#include <span>

#include "core/io/guard/datatype_check.hpp"
#include "core/io/readers.hpp"
#include "tests/unit/io/test_io_support.hpp"

// Datatype and other header messages that HDF5 1.10.8 decodes without looking where they end: they are refused before.
// Layouts of messages: HDF5 file format specification, IV.A.2.
namespace stiction::io::test {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

class IoDatatypes : public Folder {
 protected:
  /// A file of one spoiled array or attribute among sound ones, as bytes.
  std::string spoiled(const std::function<void(Spoiler&)>& spoil) {
    write_batch(at("a.h5"), small_recording());
    {
      Spoiler file(at("a.h5"));
      spoil(file);
    }
    return bytes_of(at("a.h5"));
  }
};

std::string refusal_of(const std::string& bytes) {
  return message_of(ErrorCode::bad_file, [&] { read_any(InputFile(std::as_bytes(std::span(bytes)), "image")); });
}

std::string defect_of(const std::string& message) {
  return datatype_defect(message);
}

/// Bytes of a literal with zeros in it.
template <std::size_t kCount>
std::string raw(const char (&text)[kCount]) {
  return {text, kCount - 1};
}

const std::string kInt64 = raw("\x10\x08\x00\x00\x08\x00\x00\x00\x00\x00\x40\x00");
const std::string kDouble = raw("\x11\x20\x3f\x00\x08\x00\x00\x00\x00\x00\x40\x00\x34\x0b\x00\x34\xff\x03\x00\x00");
const std::string kTextReferences =
    raw("\x19\x01\x00\x00\x10\x00\x00\x00\x10\x00\x00\x00\x01\x00\x00\x00\x00\x00\x08\x00");
/// FALSE and TRUE of one byte, as h5py writes them.
const std::string kTruth =
    raw("\x18\x02\x00\x00\x01\x00\x00\x00\x10\x08\x00\x00\x01\x00\x00\x00\x00\x00\x08\x00"
        "FALSE\0\0\0TRUE\0\0\0\0\x00\x01");

TEST(DatatypeCheck, TypesThatFilesNeedAreAccepted) {
  EXPECT_THAT(defect_of(kInt64), IsEmpty());
  EXPECT_THAT(defect_of(kDouble), IsEmpty());
  EXPECT_THAT(defect_of(kTextReferences), IsEmpty());
  EXPECT_THAT(defect_of(raw("\x13\x00\x00\x00\x05\x00\x00\x00")), IsEmpty()) << "five characters";
  EXPECT_THAT(defect_of(kTruth), IsEmpty());
  EXPECT_THAT(defect_of(kInt64 + std::string(4, '\0')), IsEmpty()) << "messages are padded";
}

TEST(DatatypeCheck, EveryTypeNeedsAllOfItsBytes) {
  for (const std::string& whole : {kInt64, kDouble, kTextReferences, kTruth}) {
    for (std::size_t length = 0; length < whole.size(); ++length) {
      EXPECT_THAT(defect_of(whole.substr(0, length)), Not(IsEmpty())) << length << " of " << whole.size() << " bytes";
    }
  }
}

TEST(DatatypeCheck, OtherClassesAreNamed) {
  for (const auto& [type_class, name] : {std::pair{2U, "times"},
                                         {4U, "bit fields"},
                                         {5U, "opaque bytes"},
                                         {6U, "compound records"},
                                         {7U, "references"},
                                         {10U, "arrays"},
                                         {11U, "an unknown type"},
                                         {15U, "an unknown type"}}) {
    std::string message(64, '\0');
    message[0] = static_cast<char>(0x10 | type_class);
    message[4] = 8;
    EXPECT_EQ(defect_of(message), std::string("holds ") + name + ", expected numbers or strings");
  }
}

TEST(DatatypeCheck, VersionsSizesAndBitsAreLookedAt) {
  const auto with = [](std::string message, std::size_t at, char byte) {
    message[at] = byte;
    return defect_of(message);
  };
  EXPECT_EQ(with(kInt64, 0, '\x00'), "has a type of unknown version");
  EXPECT_EQ(with(kInt64, 0, '\x60'), "has a type of unknown version");
  EXPECT_EQ(with(kInt64, 4, '\0'), "has a type of no bytes");
  EXPECT_EQ(with(kInt64, 4, '\x07'), "has a damaged number type") << "64 bits in 7 bytes";
  EXPECT_EQ(with(kDouble, 13, '\0'), "has a damaged number type") << "no exponent";
  EXPECT_EQ(with(kDouble, 12, '\x40'), "has a damaged number type") << "an exponent behind the last bit";
  EXPECT_EQ(with(kDouble, 2, '\x40'), "has a damaged number type") << "a sign behind the last bit";
  EXPECT_EQ(with(kTextReferences, 1, '\0'), "has a type of variable length that is no string");
  EXPECT_EQ(with(kTextReferences, 8, '\x16'), "has a damaged string type") << "strings of compounds";
  EXPECT_EQ(with(kTextReferences, 4, '\x03'), "has a damaged string type") << "references of 3 bytes";
  EXPECT_EQ(with(kTruth, 1, '\x03'), "has a header message that ends too early")
      << "three names, of which two are here";
  EXPECT_EQ(with(kTruth, 2, '\xff'), "has a header message that ends too early") << "65282 names";
}

TEST_F(IoDatatypes, TypesOfArraysAreRefusedBeforeHdf5DecodesThem) {
  const std::string bytes = spoiled([](Spoiler& file) {
    const hid_t record = H5Tcreate(H5T_COMPOUND, 8);
    H5Tinsert(record, "field with a name of its own", 0, H5T_NATIVE_DOUBLE);
    file.put("b", record, {6}, nullptr);
    H5Tclose(record);
  });
  EXPECT_THAT(refusal_of(bytes), HasSubstr("dataset 'b' holds compound records, expected numbers or strings"));
  // Members without end: HDF5 itself would follow the names beyond the message.
  std::string members = bytes;
  const std::size_t name = members.find("field with a name of its own");
  ASSERT_NE(name, std::string::npos);
  members[name - 7] = members[name - 6] = '\xff';
  EXPECT_THAT(refusal_of(members), HasSubstr("dataset 'b' holds compound records, expected numbers or strings"));
}

TEST_F(IoDatatypes, TypesOfAttributesAreRefusedBeforeHdf5DecodesThem) {
  const std::string bytes = spoiled([](Spoiler& file) {
    const hid_t opaque = H5Tcreate(H5T_OPAQUE, 8);
    H5Tset_tag(opaque, "a tag");
    const double value = 0;
    file.put_attribute("extra", opaque, &value);
    H5Tclose(opaque);
  });
  EXPECT_THAT(refusal_of(bytes),
              HasSubstr("'/' has an attribute that holds opaque bytes, expected numbers or strings"));
}

TEST_F(IoDatatypes, ATruthValueAsAttributeIsNoHindrance) {
  const std::string bytes = spoiled([](Spoiler& file) {
    const hid_t truth = H5Tenum_create(H5T_NATIVE_INT8);
    for (const auto& [name, value] : {std::pair{"FALSE", std::int8_t{0}}, {"TRUE", std::int8_t{1}}}) {
      H5Tenum_insert(truth, name, &value);
    }
    const std::int8_t yes = 1;
    file.put_attribute("extra", truth, &yes);
    H5Tclose(truth);
  });
  EXPECT_EQ(read_any(InputFile(std::as_bytes(std::span(bytes)), "image")).batch.env_count(), 2);
}

// HDF5 itself copies 65282 names from the message on: far beyond its heap, as the address sanitizer shows where this
// check is left out.
TEST_F(IoDatatypes, NamesBeyondTheMessageAreNotFollowed) {
  std::string bytes = spoiled([](Spoiler& file) {
    const hid_t truth = H5Tenum_create(H5T_NATIVE_INT8);
    for (const auto& [name, value] : {std::pair{"FALSE", std::int8_t{0}}, {"TRUE", std::int8_t{1}}}) {
      H5Tenum_insert(truth, name, &value);
    }
    file.put("b", truth, {6}, nullptr);
    H5Tclose(truth);
  });
  constexpr std::size_t kHead = 8;  // version and class, number of names, bytes of an element
  const std::size_t base = bytes.find(kTruth.substr(kHead));
  ASSERT_NE(base, std::string::npos);
  bytes[base - kHead + 2] = '\xff';
  EXPECT_THAT(refusal_of(bytes), HasSubstr("dataset 'b' has a header message that ends too early"));
}

/// Beginning of that head's message: version 1 headers put type (2), size (2), flags (1) and zeros before it.
std::size_t message_at(const std::string& bytes, const std::string& head) {
  const std::size_t at = bytes.find(head);
  EXPECT_NE(at, std::string::npos) << "no such message in the file";
  return at + 8;
}

TEST_F(IoDatatypes, AMessageThatLiesElsewhereIsRefused) {
  write_batch(at("a.h5"), small_recording());
  std::string bytes = bytes_of(at("a.h5"));
  const std::size_t at = message_at(bytes, raw("\x03\x00\x18\x00\x01\x00\x00\x00\x11"));
  bytes[at - 4] = '\x02';
  EXPECT_THAT(refusal_of(bytes), HasSubstr("has a header message that is stored elsewhere"));
}

TEST_F(IoDatatypes, AnElementThatChunksDoNotHaveIsRefused) {
  write_batch(at("a.h5"), long_recording(400));
  std::string bytes = bytes_of(at("a.h5"));
  const std::size_t at = message_at(bytes, raw("\x08\x00\x18\x00\x00\x00\x00\x00\x03\x02\x02"));
  bytes[at + 15] = '\x10';  // behind version, class, rank, address and the number of elements
  EXPECT_THAT(refusal_of(bytes), HasSubstr("has chunks of another type than its elements"));
}

TEST_F(IoDatatypes, AFilterWhoseNameDoesNotEndIsRefused) {
  write_batch(at("a.h5"), long_recording(400));
  std::string bytes = bytes_of(at("a.h5"));
  const std::size_t name = bytes.find("shuffle");
  ASSERT_NE(name, std::string::npos);
  bytes[name + 7] = 'x';
  EXPECT_THAT(refusal_of(bytes), HasSubstr("has a filter whose name does not end"));
}

TEST_F(IoDatatypes, WhatHdf5DecodesWhileItOpensAFileIsLookedAtBefore) {
  write_batch(at("a.h5"), small_recording());
  std::string bytes = bytes_of(at("a.h5"));
  constexpr std::size_t kRootAddress = 64, kPrefix = 16;  // in a superblock, of an object header, of version 0 and 1
  const std::size_t root = little_endian(bytes.data() + kRootAddress, 8);
  ASSERT_EQ(bytes[root + kPrefix], '\x10') << "the root's header goes on elsewhere";
  bytes[root + kPrefix + 2] = '\x08';  // an address without a length
  EXPECT_THAT(refusal_of(bytes), HasSubstr("image: '/' has a header message that ends too early"));
}

}  // namespace
}  // namespace stiction::io::test
