#pragma once

#include <gtest/gtest.h>
#include <hdf5.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "stiction/error.hpp"
#include "stiction/io.hpp"

namespace stiction::io::test {

/// A folder of this test's own that goes with it.
class Folder : public ::testing::Test {
 protected:
  Folder() {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::temp_directory_path() / ("stiction_" + std::string(info->test_suite_name()) + "_" +
                                                        info->name() + "_" + std::to_string(getpid()));
    std::filesystem::create_directories(folder_);
  }
  ~Folder() override {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  [[nodiscard]] std::filesystem::path at(const std::string& name) const { return folder_ / name; }

 private:
  std::filesystem::path folder_;
};

inline std::string bytes_of(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

inline void write_bytes(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

/// Equal bit for bit, so that NaN equals NaN and -0 differs from +0.
template <class T>
void expect_same_bits(const std::vector<T>& a, const std::vector<T>& b, const char* what) {
  ASSERT_EQ(a.size(), b.size()) << what;
  if (a.empty()) return;
  EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof(T)), 0) << what;
}

/// The message of the Error that `action` throws; fails if it throws none or one of another code.
inline std::string message_of(ErrorCode code, const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    EXPECT_EQ(static_cast<int>(error.code()), static_cast<int>(code)) << error.what();
    return error.what();
  }
  ADD_FAILURE() << "no Error was thrown";
  return {};
}

/// Two environments with every kind of cone and every optional part. One has 2 dofs with a free, a friction and an
/// asymmetric box cone, the other 1 dof with a unilateral row.
inline Recording small_recording() {
  Environment<double> first;
  first.cones = {{ConeKind::free, 1, -1}, {ConeKind::friction, 3, 0}, {ConeKind::box, 1, -1}};
  first.set_dense(std::vector<double>{2.0, 0.5, 0.0, 0.0,  0.0,  //
                                      0.5, 3.0, 0.0, 0.1,  0.0,  //
                                      0.0, 0.0, 1.5, 0.0,  0.0,  //
                                      0.0, 0.1, 0.0, 1.25, 0.2,  //
                                      0.0, 0.0, 0.0, 0.2,  1.0},
                  5);
  first.b = {-1.0, -0.0, 1e-310, 0.3, 7.0};
  first.R = {0.0, 1e-3, 1e-3, 1e-3, 0.25};
  first.mu = {0.0, 0.0, 0.7, 0.6, 0.0};
  first.lo = {0.0, 0.0, 0.0, 0.0, -std::numeric_limits<double>::infinity()};
  first.hi = {0.0, 0.0, 0.0, 0.0, 0.0};
  Environment<double> second;
  second.cones = {{ConeKind::unilateral, 1, -1}};
  second.set_dense(std::vector<double>{4.0}, 1);
  second.b = {-9.81};

  Recording recording;
  recording.batch.set_law(Law::coulomb);
  recording.batch.add(first);
  recording.batch.add(second);
  recording.source = "made by hand, \xc2\xb5 and all";
  recording.env_dof_offsets = {0, 2, 3};
  recording.J = {{0, 1, 2, 3, 5, 5, 6}, {0, 1, 0, 0, 1, 0}, {1.0, -1.0, 0.5, 0.25, 2.0, 1.0}};
  recording.M = {{0, 2, 4, 5}, {0, 1, 0, 1, 0}, {2.0, 0.5, 0.5, 3.0, 1.0}};
  recording.v_free = {0.1, 0.2, -9.81};
  recording.row_target = {0.0, 0.0, 0.0, 0.0, 1.0, 0.0};
  recording.lambda_ref = {1.0, 2.0, 3.0, 4.0, 5.0, 6.0};
  recording.v_ref = {0.5, 0.25, 0.125};
  recording.env_name = {"first", ""};
  recording.step = {12, -1};
  recording.dt = {0.002, 0.004};
  recording.cone_id = {3, ~std::uint64_t{0}, 0, std::uint64_t{1} << 63};
  return recording;
}

/// One environment of `rows` frictional contacts of 3 rows, tridiagonal: long enough for packed datasets.
inline Recording long_recording(Index contacts) {
  Environment<double> environment;
  const Index rows = 3 * contacts;
  for (Index i = 0; i < contacts; ++i) environment.cones.push_back({ConeKind::friction, 3, -1});
  for (Index i = 0; i < rows; ++i) {
    for (Index j = i - 1; j <= i + 1; ++j) {
      if (j < 0 || j >= rows) continue;
      environment.column.push_back(j);
      environment.A.push_back(i == j ? 2.0 : -0.5 / (1.0 + i + j));
    }
    environment.row_offsets.push_back(static_cast<Index>(environment.column.size()));
    environment.b.push_back(0.01 * i - 1.0);
    environment.mu.push_back(i % 3 == 0 ? 0.0 : 0.5);
  }
  Recording recording;
  recording.batch.set_law(Law::coulomb);
  recording.batch.add(environment);
  return recording;
}

inline void expect_same(const Recording& a, const Recording& b) {
  const auto &x = a.batch.arrays(), &y = b.batch.arrays();
  EXPECT_EQ(a.batch.law(), b.batch.law());
  expect_same_bits(x.env_row_offsets, y.env_row_offsets, "env_row_offsets");
  expect_same_bits(x.env_cone_offsets, y.env_cone_offsets, "env_cone_offsets");
  expect_same_bits(x.cone_kind, y.cone_kind, "cone_kind");
  expect_same_bits(x.cone_row_offsets, y.cone_row_offsets, "cone_row_offsets");
  expect_same_bits(x.cone_group, y.cone_group, "cone_group");
  expect_same_bits(x.row_offsets, y.row_offsets, "row_offsets");
  expect_same_bits(x.column, y.column, "column");
  expect_same_bits(x.A, y.A, "A");
  expect_same_bits(x.b, y.b, "b");
  expect_same_bits(x.R, y.R, "R");
  expect_same_bits(x.mu, y.mu, "mu");
  expect_same_bits(x.lo, y.lo, "lo");
  expect_same_bits(x.hi, y.hi, "hi");
  EXPECT_EQ(a.source, b.source);
  expect_same_bits(a.env_dof_offsets, b.env_dof_offsets, "env_dof_offsets");
  for (const auto& [p, q] : {std::pair(&a.J, &b.J), std::pair(&a.M, &b.M)}) {
    expect_same_bits(p->ptr, q->ptr, "ptr of J or M");
    expect_same_bits(p->col, q->col, "col of J or M");
    expect_same_bits(p->val, q->val, "val of J or M");
  }
  expect_same_bits(a.v_free, b.v_free, "v_free");
  expect_same_bits(a.row_target, b.row_target, "row_target");
  expect_same_bits(a.lambda_ref, b.lambda_ref, "lambda_ref");
  expect_same_bits(a.v_ref, b.v_ref, "v_ref");
  EXPECT_EQ(a.env_name, b.env_name);
  EXPECT_EQ(a.step, b.step);
  EXPECT_EQ(a.dt, b.dt);
  EXPECT_EQ(a.cone_id, b.cone_id);
}

/// An HDF5 file opened to spoil it, by HDF5 itself.
class Spoiler {
 public:
  explicit Spoiler(const std::filesystem::path& path) : file_(H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT)) {}
  static Spoiler make(const std::filesystem::path& path) {
    return Spoiler(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT));
  }
  ~Spoiler() { H5Fclose(file_); }
  Spoiler(const Spoiler&) = delete;
  Spoiler& operator=(const Spoiler&) = delete;

  [[nodiscard]] hid_t file() const { return file_; }
  void group(const char* path) { H5Gclose(H5Gcreate2(file_, path, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT)); }
  void remove(const char* path) { H5Ldelete(file_, path, H5P_DEFAULT); }
  void remove_attribute(const char* name) { H5Adelete(file_, name); }

  /// Replaces a dataset by one of any type, shape and creation properties; no data: nothing is written.
  void put(const char* path, hid_t type, const std::vector<hsize_t>& shape, const void* data,
           hid_t properties = H5P_DEFAULT) {
    if (H5Lexists(file_, path, H5P_DEFAULT) > 0) remove(path);
    const hid_t space = H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr);
    const hid_t dataset = H5Dcreate2(file_, path, type, space, H5P_DEFAULT, properties, H5P_DEFAULT);
    ASSERT_GE(dataset, 0) << path;
    if (data != nullptr) {
      ASSERT_GE(H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data), 0) << path;
    }
    H5Dclose(dataset);
    H5Sclose(space);
  }
  void put(const char* path, const std::vector<double>& values) {
    put(path, H5T_NATIVE_DOUBLE, {values.size()}, values.data());
  }
  void put(const char* path, const std::vector<std::int32_t>& values) {
    put(path, H5T_NATIVE_INT32, {values.size()}, values.data());
  }
  void put(const char* path, const std::vector<std::int64_t>& values) {
    put(path, H5T_NATIVE_INT64, {values.size()}, values.data());
  }
  void put_attribute(const char* name, hid_t type, const void* value) {
    if (H5Aexists(file_, name) > 0) remove_attribute(name);
    const hid_t space = H5Screate(H5S_SCALAR);
    const hid_t attribute = H5Acreate2(file_, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
    H5Awrite(attribute, type, value);
    H5Aclose(attribute);
    H5Sclose(space);
  }
  void put_attribute(const char* name, const std::string& value) {
    const hid_t type = H5Tcopy(H5T_C_S1);
    H5Tset_size(type, value.size() + 1);
    put_attribute(name, type, value.c_str());
    H5Tclose(type);
  }

 private:
  explicit Spoiler(hid_t file) : file_(file) {}
  hid_t file_;
};

}  // namespace stiction::io::test
