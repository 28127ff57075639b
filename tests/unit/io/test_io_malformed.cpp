#include <gmock/gmock.h>

#include "tests/unit/io/test_io_support.hpp"

// Every way in which a file can be well-formed HDF5 and yet wrong, and the sentence for it.
namespace stiction::io::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class IoMalformed : public Folder {
 protected:
  std::string read_refusal() {
    return message_of(ErrorCode::bad_file, [this] { read_batch(at("a.h5")); });
  }
  std::string refusal(const std::function<void(Spoiler&)>& spoil) {
    write_batch(at("a.h5"), small_recording());
    {
      Spoiler file(at("a.h5"));
      spoil(file);
    }
    const std::string message = read_refusal();
    EXPECT_THAT(message, AllOf(HasSubstr("a.h5: "), Not(HasSubstr("\n"))));
    return message;
  }
};

TEST_F(IoMalformed, AFileThatIsNotThereIsAnIoError) {
  EXPECT_THAT(message_of(ErrorCode::io, [this] { read_batch(at("none.h5")); }), HasSubstr("none.h5: no such file"));
  EXPECT_THAT(message_of(ErrorCode::io, [this] { read_batch(at(".")); }), HasSubstr("not a regular file"));
}

TEST_F(IoMalformed, FilesThatAreNotHdf5AreCalledSo) {
  write_bytes(at("a.h5"), "solver,iterations\npgs,12\n");
  EXPECT_THAT(read_refusal(), HasSubstr("a.h5: not an HDF5 file"));
  write_bytes(at("a.h5"), "");
  EXPECT_THAT(read_refusal(), HasSubstr("a.h5: the file is empty"));
}

TEST_F(IoMalformed, AnHdf5FileOfSomethingElseIsCalledSo) {
  Spoiler::make(at("a.h5")).put("temperature", std::vector<double>{1.0});
  EXPECT_THAT(read_refusal(),
              HasSubstr("neither a contact batch (attribute 'format' is missing) nor an FCLIB problem"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.put_attribute("format", std::string("contact-solution")); }),
              HasSubstr("attribute 'format' is 'contact-solution', expected 'contact-batch'"));
}

TEST_F(IoMalformed, EveryRequiredDatasetIsMissed) {
  for (const char* name :
       {"b", "R", "cone_kind", "cone_row_ptr", "row_param", "env_row_ptr", "env_cone_ptr", "A/ptr", "A/col", "A/val"}) {
    EXPECT_THAT(refusal([name](Spoiler& f) { f.remove(name); }),
                HasSubstr("dataset '" + std::string(name) + "' is missing"));
  }
  EXPECT_THAT(refusal([](Spoiler& f) { f.remove("A"); }), HasSubstr("group 'A' is missing"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.remove("env_dof_ptr"); }),
              HasSubstr("dataset 'env_dof_ptr' is missing, 'J' needs it"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.remove("row_lo"); }), HasSubstr("dataset 'row_lo' is missing"));
}

TEST_F(IoMalformed, AttributesAreChecked) {
  EXPECT_THAT(refusal([](Spoiler& f) { f.remove_attribute("version"); }), HasSubstr("attribute 'version' is missing"));
  const std::int64_t two = 2;
  EXPECT_THAT(refusal([&](Spoiler& f) { f.put_attribute("version", H5T_NATIVE_INT64, &two); }),
              HasSubstr("contact-batch version 2 is not supported, expected 1"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.put_attribute("version", std::string("1")); }),
              HasSubstr("attribute 'version' is not one integer"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.remove_attribute("law"); }), HasSubstr("attribute 'law' is missing"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.put_attribute("law", std::string("painleve")); }),
              HasSubstr("attribute 'law' is 'painleve', expected 'convex' or 'coulomb'"));
  EXPECT_THAT(refusal([&](Spoiler& f) { f.put_attribute("law", H5T_NATIVE_INT64, &two); }),
              HasSubstr("attribute 'law' is not one string"));
}

TEST_F(IoMalformed, WrongTypesAreNamed) {
  const std::vector<double> reals(12, 0.0);
  EXPECT_THAT(refusal([&](Spoiler& f) { f.put("A/col", reals); }),
              HasSubstr("dataset 'A/col' holds floating-point numbers, expected integers"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.put("b", std::vector<std::int32_t>(6, 0)); }),
              HasSubstr("dataset 'b' holds integers, expected floating-point numbers"));
  EXPECT_THAT(refusal([&](Spoiler& f) {
                const hid_t text = H5Tcopy(H5T_C_S1);
                H5Tset_size(text, 8);
                f.put("b", text, {6}, std::string(48, 'x').data());
                H5Tclose(text);
              }),
              HasSubstr("dataset 'b' holds strings, expected floating-point numbers"));
  EXPECT_THAT(refusal([&](Spoiler& f) {
                const hid_t pair = H5Tcreate(H5T_COMPOUND, 16);
                H5Tinsert(pair, "re", 0, H5T_NATIVE_DOUBLE);
                H5Tinsert(pair, "im", 8, H5T_NATIVE_DOUBLE);
                f.put("b", pair, {6}, reals.data());
                H5Tclose(pair);
              }),
              HasSubstr("dataset 'b' holds compound records, expected numbers or strings"));
  EXPECT_THAT(refusal([&](Spoiler& f) {
                const hid_t boolean = H5Tenum_create(H5T_NATIVE_INT8);
                const std::int8_t no = 0;
                H5Tenum_insert(boolean, "FALSE", &no);
                f.put("cone_kind", boolean, {4}, reals.data());
                H5Tclose(boolean);
              }),
              HasSubstr("dataset 'cone_kind' holds enumerators, expected integers"));
  EXPECT_THAT(refusal([&](Spoiler& f) {
                const hid_t half = H5Tcopy(H5T_IEEE_F32LE);
                H5Tset_fields(half, 15, 10, 5, 0, 10);
                H5Tset_size(half, 2);
                H5Tset_ebias(half, 15);
                f.put("b", half, {6}, reals.data());
                H5Tclose(half);
              }),
              HasSubstr("dataset 'b' holds floating-point numbers of no standard layout (2 bytes)"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.put("env_name", std::vector<double>{1.0, 2.0}); }),
              HasSubstr("dataset 'env_name' holds floating-point numbers, expected strings"));
}

TEST_F(IoMalformed, WrongShapesAreNamed) {
  const std::vector<double> reals(12, 0.0);
  EXPECT_THAT(refusal([&](Spoiler& f) { f.put("b", H5T_NATIVE_DOUBLE, {6, 1}, reals.data()); }),
              HasSubstr("dataset 'b' has 2 dimensions, expected 1"));
  EXPECT_THAT(refusal([&](Spoiler& f) { f.put("R", std::vector<double>(5, 0.0)); }),
              HasSubstr("dataset 'R' has 5 elements, expected 6"));
  EXPECT_THAT(refusal([&](Spoiler& f) { f.put("A/col", std::vector<std::int32_t>(3, 0)); }),
              HasSubstr("dataset 'A/col' has 3 elements, expected"));
  EXPECT_THAT(refusal([](Spoiler& f) {
                f.remove("b");
                f.group("b");
              }),
              HasSubstr("dataset 'b' is not a dataset"));
  EXPECT_THAT(refusal([](Spoiler& f) {
                f.remove("A");
                f.put("A", std::vector<double>{1.0});
              }),
              HasSubstr("'A' is not a group"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.put("step", std::vector<std::int64_t>{1}); }),
              HasSubstr("dataset 'step' has 1 elements, expected 2"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.put("dt", std::vector<double>(3, 0.1)); }),
              HasSubstr("dataset 'dt' has 3 elements, expected 2"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.put("cone_id", std::vector<std::int64_t>(2, 1)); }),
              HasSubstr("dataset 'cone_id' has 2 elements, expected 4"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.put("cone_id", std::vector<std::int64_t>{1, 2, -3, 4}); }),
              HasSubstr("dataset 'cone_id' holds -3 at position 2, expected a number that is not negative"));
}

TEST_F(IoMalformed, OffsetsThatCannotIndexAreRefused) {
  EXPECT_THAT(refusal([](Spoiler& f) { f.put("env_row_ptr", std::vector<std::int64_t>{1, 5, 6}); }),
              HasSubstr("dataset 'env_row_ptr' starts at 1, expected 0"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.put("env_row_ptr", std::vector<std::int64_t>{0, 7, 6}); }),
              HasSubstr("dataset 'env_row_ptr' decreases from 7 to 6 at position 2"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.put("cone_row_ptr", std::vector<std::int64_t>{0, 1, 4, 5, 9000000000}); }),
              HasSubstr("dataset 'cone_row_ptr' ends at 9000000000, expected 6"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.put("env_row_ptr", std::vector<std::int64_t>{}); }),
              HasSubstr("dataset 'env_row_ptr' is empty"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.put("env_dof_ptr", std::vector<std::int64_t>{0, -2, 3}); }),
              HasSubstr("dataset 'env_dof_ptr' decreases from 0 to -2"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.put("J/col", std::vector<std::int32_t>{0, 2, 0, 0, 1, 0}); }),
              HasSubstr("dataset 'J/col' holds 2 at position 1, environment 0 has 2 degrees of freedom"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.put("M/col", std::vector<std::int32_t>{0, 1, 0, 1, -1}); }),
              HasSubstr("dataset 'M/col' holds -1 at position 4"));
}

TEST_F(IoMalformed, NumbersThatDoNotFitAreNotCutOff) {
  write_batch(at("a.h5"), small_recording());
  const auto entries = static_cast<std::size_t>(small_recording().batch.arrays().column.size());
  std::vector<std::int64_t> columns(entries, 0);
  columns[2] = std::int64_t{1} << 32;
  EXPECT_THAT(refusal([&](Spoiler& f) { f.put("A/col", columns); }),
              HasSubstr("dataset 'A/col' holds 4294967296 at position 2, which does not fit 32 bits"));
  const std::vector<std::uint64_t> huge = {0, 5, ~std::uint64_t{0}};
  EXPECT_THAT(refusal([&](Spoiler& f) { f.put("env_row_ptr", H5T_NATIVE_UINT64, {3}, huge.data()); }),
              HasSubstr("dataset 'env_row_ptr' holds 18446744073709551615 at position 2"));
}

TEST_F(IoMalformed, ColumnsAndNumbersAreLeftToValidate) {
  write_batch(at("a.h5"), small_recording());
  {
    Spoiler file(at("a.h5"));
    std::vector<double> b(6, 0.0);
    b[1] = std::numeric_limits<double>::quiet_NaN();
    file.put("b", b);
    file.put("A/col", std::vector<std::int32_t>(small_recording().batch.arrays().column.size(), 77));
  }
  const Recording recording = read_batch(at("a.h5"));
  EXPECT_FALSE(validate(recording.batch.view()).empty());
}

TEST_F(IoMalformed, NothingOutsideOfTheFileIsRead) {
  EXPECT_THAT(refusal([](Spoiler& f) {
                f.remove("b");
                H5Lcreate_external("/etc/passwd", "/b", f.file(), "b", H5P_DEFAULT, H5P_DEFAULT);
              }),
              HasSubstr("'b' is a soft or external link"));
  EXPECT_THAT(refusal([](Spoiler& f) {
                f.remove("b");
                H5Lcreate_soft("/R", f.file(), "b", H5P_DEFAULT, H5P_DEFAULT);
              }),
              HasSubstr("'b' is a soft or external link"));
  EXPECT_THAT(refusal([](Spoiler& f) {
                const hid_t properties = H5Pcreate(H5P_DATASET_CREATE);
                H5Pset_external(properties, "elsewhere.raw", 0, 6 * sizeof(double));
                f.put("b", H5T_NATIVE_DOUBLE, {6}, nullptr, properties);
                H5Pclose(properties);
              }),
              HasSubstr("dataset 'b' keeps its data in another file"));
}

TEST_F(IoMalformed, ClaimsBeyondTheFileAreRefusedBeforeMemoryIsTaken) {
  constexpr hsize_t kTera = hsize_t{1} << 40;
  EXPECT_THAT(refusal([](Spoiler& f) { f.put("b", H5T_NATIVE_DOUBLE, {kTera}, nullptr); }),
              HasSubstr("dataset 'b' claims 1099511627776 elements"));
  EXPECT_THAT(refusal([](Spoiler& f) {
                const hid_t properties = H5Pcreate(H5P_DATASET_CREATE);
                const hsize_t chunk = 1 << 16;
                H5Pset_chunk(properties, 1, &chunk);
                H5Pset_deflate(properties, 9);
                f.put("b", H5T_NATIVE_DOUBLE, {kTera}, nullptr, properties);
                H5Pclose(properties);
              }),
              HasSubstr("dataset 'b' claims 1099511627776 elements"));
  EXPECT_THAT(refusal([](Spoiler& f) {
                const hid_t properties = H5Pcreate(H5P_DATASET_CREATE);
                const hsize_t chunk = 4;
                H5Pset_chunk(properties, 1, &chunk);
                f.put("b", H5T_NATIVE_DOUBLE, {6}, nullptr, properties);
                H5Pclose(properties);
              }),
              HasSubstr("dataset 'b' lacks the chunk that begins at element 0"));
}

TEST_F(IoMalformed, OnlyWellKnownFiltersAreApplied) {
  EXPECT_THAT(refusal([](Spoiler& f) {
                const hid_t properties = H5Pcreate(H5P_DATASET_CREATE);
                const hsize_t chunk = 6;
                H5Pset_chunk(properties, 1, &chunk);
                H5Pset_scaleoffset(properties, H5Z_SO_FLOAT_DSCALE, 2);
                const std::vector<double> b(6, 1.0);
                f.put("b", H5T_NATIVE_DOUBLE, {6}, b.data(), properties);
                H5Pclose(properties);
              }),
              HasSubstr("dataset 'b' is packed with filter 6, only deflate, shuffle and fletcher32 are read"));
}

}  // namespace
}  // namespace stiction::io::test
