#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "tests/unit/io/test_io_support.hpp"

namespace stiction::io::test {
namespace {

using ::testing::HasSubstr;

class IoFclib : public Folder {};

using Dense = std::vector<std::vector<double>>;

/// FCLIB's storage of a dense matrix in one of its three codes.
enum class Storage { triplets, by_columns, by_rows };

void put_integer(Spoiler& file, const std::string& path, std::int32_t value) {
  file.put(path.c_str(), std::vector<std::int32_t>{value});
}

void put_matrix(Spoiler& file, const std::string& path, const Dense& matrix, std::int32_t columns, Storage storage) {
  const auto rows = static_cast<std::int32_t>(matrix.size());
  std::vector<std::int32_t> i, p;
  std::vector<double> x;
  const std::int32_t lines = storage == Storage::by_columns ? columns : rows;
  const std::int32_t across = storage == Storage::by_columns ? rows : columns;
  if (storage != Storage::triplets) p.push_back(0);
  for (std::int32_t line = 0; line < lines; ++line) {
    for (std::int32_t place = 0; place < across; ++place) {
      const std::int32_t row = storage == Storage::by_columns ? place : line;
      const std::int32_t column = storage == Storage::by_columns ? line : place;
      const double value = matrix[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)];
      if (value == 0.0) continue;
      x.push_back(value);
      i.push_back(storage == Storage::triplets ? row : place);
      if (storage == Storage::triplets) p.push_back(column);
    }
    if (storage != Storage::triplets) p.push_back(static_cast<std::int32_t>(x.size()));
  }
  file.group(path.c_str());
  put_integer(file, path + "/m", rows);
  put_integer(file, path + "/n", columns);
  put_integer(file, path + "/nz",
              storage == Storage::triplets     ? static_cast<std::int32_t>(x.size())
              : storage == Storage::by_columns ? -1
                                               : -2);
  put_integer(file, path + "/nzmax", static_cast<std::int32_t>(x.size()) + 7);  // more than is used, as real files have
  file.put((path + "/i").c_str(), i);
  file.put((path + "/p").c_str(), p);
  file.put((path + "/x").c_str(), x);
}

Dense dense_of(const Recording& recording, Offset env = 0) {
  const auto& arrays = recording.batch.arrays();
  const auto first = arrays.env_row_offsets[static_cast<std::size_t>(env)];
  const auto rows = static_cast<std::size_t>(arrays.env_row_offsets[static_cast<std::size_t>(env) + 1] - first);
  Dense matrix(rows, std::vector<double>(rows, 0.0));
  for (std::size_t row = 0; row < rows; ++row) {
    const std::size_t at = static_cast<std::size_t>(first) + row;
    for (auto k = static_cast<std::size_t>(arrays.row_offsets[at]);
         k < static_cast<std::size_t>(arrays.row_offsets[at + 1]); ++k) {
      matrix[row][static_cast<std::size_t>(arrays.column[k])] += arrays.A[k];
    }
  }
  return matrix;
}

// Not symmetric, so that a transposed reading is noticed.
const Dense kW = {{4.0, 0.5, 0.0}, {0.25, 3.0, -1.0}, {0.0, -2.0, 5.0}};

void make_local(const std::filesystem::path& path, Storage storage) {
  Spoiler file = Spoiler::make(path);
  file.group("fclib_local");
  put_integer(file, "fclib_local/spacedim", 3);
  put_matrix(file, "fclib_local/W", kW, 3, storage);
  file.group("fclib_local/vectors");
  file.put("fclib_local/vectors/q", std::vector<double>{-1.0, 0.5, 0.25});
  file.put("fclib_local/vectors/mu", std::vector<double>{0.3});
}

TEST_F(IoFclib, ALocalProblemReadsTheSameInEveryStorage) {
  for (const Storage storage : {Storage::triplets, Storage::by_columns, Storage::by_rows}) {
    make_local(at("a.hdf5"), storage);
    EXPECT_EQ(detect(at("a.hdf5")), FileKind::fclib_local);
    const Recording recording = read_batch(at("a.hdf5"));
    EXPECT_EQ(dense_of(recording), kW) << "storage " << static_cast<int>(storage);
    const auto& arrays = recording.batch.arrays();
    EXPECT_EQ(arrays.b, (std::vector<double>{-1.0, 0.5, 0.25}));
    EXPECT_EQ(arrays.mu, (std::vector<double>{0.0, 0.3, 0.3}));
    EXPECT_EQ(arrays.cone_kind, std::vector<ConeKind>{ConeKind::friction});
    EXPECT_EQ(recording.batch.law(), Law::coulomb);
    EXPECT_TRUE(validate(recording.batch.view()).empty());
  }
}

TEST_F(IoFclib, DuplicateTripletsAddUp) {
  make_local(at("a.hdf5"), Storage::triplets);
  {
    Spoiler file(at("a.hdf5"));
    file.put("fclib_local/W/i", std::vector<std::int32_t>{2, 0, 1, 2, 0});
    file.put("fclib_local/W/p", std::vector<std::int32_t>{2, 0, 1, 2, 0});
    file.put("fclib_local/W/x", std::vector<double>{1.0, 2.0, 3.0, 4.0, 100.0});
    put_integer(file, "fclib_local/W/nz", 4);  // the fifth is room that was not used
  }
  const Recording recording = read_batch(at("a.hdf5"));
  EXPECT_EQ(dense_of(recording), (Dense{{2.0, 0.0, 0.0}, {0.0, 3.0, 0.0}, {0.0, 0.0, 5.0}}));
  EXPECT_EQ(recording.batch.arrays().A.size(), 3U);
}

TEST_F(IoFclib, EqualitiesOfALocalProblemBecomeFreeRows) {
  make_local(at("a.hdf5"), Storage::by_rows);
  {
    Spoiler file(at("a.hdf5"));
    put_matrix(file, "fclib_local/V", {{1.0}, {0.0}, {2.0}}, 1, Storage::triplets);
    put_matrix(file, "fclib_local/R", {{6.0}}, 1, Storage::by_columns);
    file.put("fclib_local/vectors/s", std::vector<double>{-3.0});
  }
  const Recording recording = read_batch(at("a.hdf5"));
  EXPECT_EQ(dense_of(recording),
            (Dense{{4.0, 0.5, 0.0, 1.0}, {0.25, 3.0, -1.0, 0.0}, {0.0, -2.0, 5.0, 2.0}, {1.0, 0.0, 2.0, 6.0}}));
  EXPECT_EQ(recording.batch.arrays().b, (std::vector<double>{-1.0, 0.5, 0.25, -3.0}));
  EXPECT_EQ(recording.batch.arrays().cone_kind, (std::vector<ConeKind>{ConeKind::friction, ConeKind::free}));
  EXPECT_TRUE(validate(recording.batch.view()).empty());
}

/// Three degrees of freedom in two blocks, {0, 2} coupled and {1}, and one planar contact. By hand M = [2 0 2; 0 2 0;
///   2 0 4] has M^-1 = 1/2 [2 0 -1; 0 1 0; -1 0 1]. H' = [1 0 0; 0 1 1].
void make_global(const std::filesystem::path& path) {
  Spoiler file = Spoiler::make(path);
  file.group("fclib_global");
  put_integer(file, "fclib_global/spacedim", 2);
  put_matrix(file, "fclib_global/M", {{2.0, 0.0, 2.0}, {0.0, 2.0, 0.0}, {2.0, 0.0, 4.0}}, 3, Storage::triplets);
  put_matrix(file, "fclib_global/H", {{1.0, 0.0}, {0.0, 1.0}, {0.0, 1.0}}, 2, Storage::by_columns);
  file.group("fclib_global/vectors");
  file.put("fclib_global/vectors/f", std::vector<double>{2.0, 4.0, 0.0});
  file.put("fclib_global/vectors/w", std::vector<double>{0.5, -1.0});
  file.put("fclib_global/vectors/mu", std::vector<double>{0.8});
}

TEST_F(IoFclib, AGlobalProblemIsCondensed) {
  make_global(at("a.hdf5"));
  EXPECT_EQ(detect(at("a.hdf5")), FileKind::fclib_global);
  const Recording recording = read_batch(at("a.hdf5"));
  // All numbers are powers of two or sums of few, so equality is exact.
  EXPECT_EQ(dense_of(recording), (Dense{{1.0, -0.5}, {-0.5, 1.0}}));
  EXPECT_EQ(recording.v_free, (std::vector<double>{2.0, 2.0, -1.0}));
  EXPECT_EQ(recording.batch.arrays().b, (std::vector<double>{2.5, 0.0}));
  EXPECT_EQ(recording.row_target, (std::vector<double>{-0.5, 1.0}));
  EXPECT_EQ(recording.batch.arrays().mu, (std::vector<double>{0.0, 0.8}));
  EXPECT_EQ(recording.env_dof_offsets, (std::vector<Offset>{0, 3}));
  EXPECT_EQ(recording.J.ptr, (std::vector<Offset>{0, 1, 3}));
  EXPECT_EQ(recording.J.col, (std::vector<Index>{0, 1, 2}));
  EXPECT_EQ(recording.M.val, (std::vector<double>{2.0, 2.0, 2.0, 2.0, 4.0}));
  // The recording is complete: it survives a round trip through a contact batch.
  write_batch(at("b.h5"), recording);
  expect_same(read_batch(at("b.h5")), recording);
}

TEST_F(IoFclib, EqualitiesOfAGlobalProblemBecomeFreeRows) {
  make_global(at("a.hdf5"));
  {
    Spoiler file(at("a.hdf5"));
    put_matrix(file, "fclib_global/G", {{0.0}, {2.0}, {0.0}}, 1, Storage::triplets);
    file.put("fclib_global/vectors/b", std::vector<double>{8.0});
  }
  const Recording recording = read_batch(at("a.hdf5"));
  EXPECT_EQ(dense_of(recording), (Dense{{1.0, -0.5, 0.0}, {-0.5, 1.0, 1.0}, {0.0, 1.0, 2.0}}));
  EXPECT_EQ(recording.batch.arrays().b, (std::vector<double>{2.5, 0.0, 12.0}));
  EXPECT_EQ(recording.batch.arrays().cone_kind, (std::vector<ConeKind>{ConeKind::friction, ConeKind::free}));
}

TEST_F(IoFclib, AMassMatrixThatNeedsRowExchangeIsCondensed) {
  make_global(at("a.hdf5"));
  {
    Spoiler file(at("a.hdf5"));
    file.remove("fclib_global/M");
    put_matrix(file, "fclib_global/M", {{0.0, 2.0, 0.0}, {4.0, 0.0, 0.0}, {0.0, 0.0, 1.0}}, 3, Storage::by_rows);
  }
  // M^-1 = [0 1/4 0; 1/2 0 0; 0 0 1]
  EXPECT_EQ(dense_of(read_batch(at("a.hdf5"))), (Dense{{0.0, 0.25}, {0.5, 1.0}}));
}

TEST_F(IoFclib, MalformedProblemsAreRefusedInOneSentence) {
  const auto refusal = [&](bool global, const std::function<void(Spoiler&)>& spoil) {
    global ? make_global(at("a.hdf5")) : make_local(at("a.hdf5"), Storage::by_rows);
    {
      Spoiler file(at("a.hdf5"));
      spoil(file);
    }
    return message_of(ErrorCode::bad_file, [&] { read_batch(at("a.hdf5")); });
  };
  EXPECT_THAT(refusal(false, [](Spoiler& f) { put_integer(f, "fclib_local/spacedim", 4); }),
              HasSubstr("a.hdf5: dataset 'fclib_local/spacedim' is 4, expected 2 or 3"));
  EXPECT_THAT(refusal(false, [](Spoiler& f) { f.put("fclib_local/vectors/mu", std::vector<double>{0.3, 0.3}); }),
              HasSubstr("'fclib_local/vectors/mu' has 2 elements, 'q' has 3, expected 3 times as many"));
  EXPECT_THAT(refusal(false, [](Spoiler& f) { put_integer(f, "fclib_local/W/m", 1 << 30); }),
              HasSubstr("matrix 'fclib_local/W' is 1073741824 x 3, the vectors make it 3 x 3"));
  EXPECT_THAT(refusal(false, [](Spoiler& f) { put_integer(f, "fclib_local/W/nz", -3); }),
              HasSubstr("dataset 'fclib_local/W/nz' is -3"));
  EXPECT_THAT(refusal(false, [](Spoiler& f) { put_integer(f, "fclib_local/W/nz", 100); }),
              HasSubstr("dataset 'fclib_local/W/nz' counts 100 triplets, the arrays hold"));
  EXPECT_THAT(refusal(false, [](Spoiler& f) { f.put("fclib_local/W/p", std::vector<std::int32_t>{0, 2, 5, 100}); }),
              HasSubstr("dataset 'fclib_local/W/p' ends at 100"));
  EXPECT_THAT(refusal(false, [](Spoiler& f) { f.put("fclib_local/W/p", std::vector<std::int32_t>{0, 2}); }),
              HasSubstr("dataset 'fclib_local/W/p' has 2 elements, expected 4"));
  EXPECT_THAT(
      refusal(false, [](Spoiler& f) { f.put("fclib_local/W/i", std::vector<std::int32_t>{0, 1, 0, 3, 2, 1, 2}); }),
      HasSubstr("matrix 'fclib_local/W' has column 3 at entry 3, expected 0 to 3 exclusive"));
  EXPECT_THAT(refusal(false, [](Spoiler& f) { f.put("fclib_local/vectors/s", std::vector<double>{1.0}); }),
              HasSubstr("dataset 'fclib_local/V/m' is missing"));
  EXPECT_THAT(refusal(true, [](Spoiler& f) { f.remove("fclib_global/H"); }),
              HasSubstr("dataset 'fclib_global/H/m' is missing"));
  EXPECT_THAT(
      refusal(true, [](Spoiler& f) { f.put("fclib_global/M/x", std::vector<double>{2.0, 2.0, 2.0, 2.0, 2.0}); }),
      HasSubstr("M is singular in the block of degree of freedom 0"));
}

TEST_F(IoFclib, RollingProblemsAreRefusedWithTheReason) {
  Spoiler::make(at("a.hdf5")).group("fclib_global_rolling");
  EXPECT_EQ(detect(at("a.hdf5")), FileKind::fclib_rolling);
  EXPECT_THAT(message_of(ErrorCode::bad_file, [&] { read_batch(at("a.hdf5")); }), HasSubstr("FCLIB rolling problem"));
}

TEST_F(IoFclib, AnEnvironmentComesBackThroughFclib) {
  const Recording recording = long_recording(700);
  write_fclib_local(at("a.hdf5"), recording, 0);
  EXPECT_EQ(detect(at("a.hdf5")), FileKind::fclib_local);
  const Recording back = read_batch(at("a.hdf5"));
  const auto &x = recording.batch.arrays(), &y = back.batch.arrays();
  expect_same_bits(x.A, y.A, "A");
  expect_same_bits(x.column, y.column, "column");
  expect_same_bits(x.row_offsets, y.row_offsets, "row_offsets");
  expect_same_bits(x.b, y.b, "b");
  expect_same_bits(x.mu, y.mu, "mu");
}

TEST_F(IoFclib, ComplianceGoesIntoTheDiagonal) {
  Environment<double> environment;
  environment.cones = {{ConeKind::friction, 2, -1}};
  environment.set_dense(std::vector<double>{2.0, 1.0, 1.0, 2.0}, 2);
  environment.b = {1.0, 2.0};
  environment.R = {0.5, 0.0};
  environment.mu = {0.0, 0.25};
  Recording recording;
  recording.batch.set_law(Law::coulomb);
  recording.batch.add(Environment<double>{});
  recording.batch.add(environment);
  write_fclib_local(at("a.hdf5"), recording, 1);
  const Recording back = read_batch(at("a.hdf5"));
  EXPECT_EQ(dense_of(back), (Dense{{2.5, 1.0}, {1.0, 2.0}}));
  EXPECT_EQ(back.batch.arrays().cone_row_offsets, (std::vector<Offset>{0, 2}));
}

TEST_F(IoFclib, WhatFclibCannotSayIsRefused) {
  const auto refusal = [&](const Recording& recording, Offset env) {
    return message_of(ErrorCode::invalid_argument, [&] { write_fclib_local(at("a.hdf5"), recording, env); });
  };
  EXPECT_THAT(refusal(small_recording(), 0), HasSubstr("cone 0 of environment 0 is free"));
  EXPECT_THAT(refusal(small_recording(), 2), HasSubstr("environment 2 is not there, the batch has 2"));
  EXPECT_THAT(refusal(small_recording(), -1), HasSubstr("environment -1 is not there"));
  Recording convex = long_recording(1);
  convex.batch.set_law(Law::convex);
  EXPECT_THAT(refusal(convex, 0), HasSubstr("convex law"));

  Environment<double> environment;
  environment.cones = {{ConeKind::friction, 3, -1}};
  environment.set_dense(std::vector<double>{1, 0, 0, 0, 1, 0, 0, 0, 1}, 3);
  environment.b = {1.0, 2.0, 3.0};
  environment.mu = {0.0, 0.5, 0.75};
  Recording anisotropic;
  anisotropic.batch.set_law(Law::coulomb);
  anisotropic.batch.add(environment);
  EXPECT_THAT(refusal(anisotropic, 0), HasSubstr("different mu for each axis"));
  EXPECT_FALSE(std::filesystem::exists(at("a.hdf5")));
}

/// Systems exist as FCLIB files and, condensed by numpy, in the shared Coulomb batches.
TEST(IoFclibShared, PublicProblemsAgreeWithTheirCondensedBatches) {
  const char* environment = std::getenv("STICTION_SHARED_DIR");
  const std::filesystem::path shared = environment != nullptr ? environment : STICTION_SHARED_DIR;
  const auto fclib = shared / "data" / "fclib", coulomb = shared / "data" / "coulomb";
  if (!std::filesystem::is_directory(fclib) || !std::filesystem::is_directory(coulomb)) {
    GTEST_SKIP() << "no data/fclib and data/coulomb under STICTION_SHARED_DIR";
  }
  int compared = 0;
  for (const auto& batch_file : std::filesystem::directory_iterator(coulomb)) {
    const Recording batch = read_batch(batch_file.path());
    for (std::size_t env = 0; env < batch.env_name.size(); ++env) {
      const std::string& name = batch.env_name[env];
      const bool local = name.find(".local.dat") != std::string::npos;
      const auto file = fclib / (name.substr(0, name.find(local ? ".local.dat" : ".condensed.dat")) + ".hdf5");
      if (!std::filesystem::exists(file)) continue;
      SCOPED_TRACE(name);
      const Recording problem = read_batch(file);
      EXPECT_TRUE(validate(problem.batch.view()).empty());
      const Dense expected = dense_of(batch, static_cast<Offset>(env)), found = dense_of(problem);
      ASSERT_EQ(expected.size(), found.size());
      double largest = 0.0, difference = 0.0, largest_b = 0.0, difference_b = 0.0;
      const auto first = static_cast<std::size_t>(batch.batch.arrays().env_row_offsets[env]);
      for (std::size_t row = 0; row < expected.size(); ++row) {
        for (std::size_t column = 0; column < expected.size(); ++column) {
          largest = std::max(largest, std::abs(expected[row][column]));
          difference = std::max(difference, std::abs(expected[row][column] - found[row][column]));
        }
        const double b = batch.batch.arrays().b[first + row];
        largest_b = std::max(largest_b, std::abs(b));
        difference_b = std::max(difference_b, std::abs(b - problem.batch.arrays().b[row]));
        EXPECT_EQ(batch.batch.arrays().mu[first + row], problem.batch.arrays().mu[row]);
      }
      // Local problems are the same numbers. Condensed ones were condensed by another program, which dropped entries
      // below 1e-14 of the largest and solved with M in another order.
      EXPECT_LE(difference, local ? 0.0 : 1e-13 * largest);
      EXPECT_LE(difference_b, local ? 0.0 : 1e-13 * largest_b);
      ++compared;
    }
  }
  EXPECT_EQ(compared, 10) << "3 local and 7 global problems are shared";
}

}  // namespace
}  // namespace stiction::io::test
