#include <gmock/gmock.h>

#include "tests/unit/io/test_io_support.hpp"

namespace stiction::io::test {
namespace {

using ::testing::HasSubstr;

class IoSolution : public Folder {};

SolutionFile sample(Precision precision) {
  SolutionFile solution;
  solution.precision = precision;
  solution.lambda = {1.0, -0.0, static_cast<double>(0.1F), std::numeric_limits<double>::infinity()};
  solution.w = {0.5, 0.25, static_cast<double>(-0.3F), 0.0};
  solution.env_row_offsets = {0, 3, 4};
  solution.status = {
      EnvStatus{1e-7, 1e-5, 0, 42, EnvCode::solved, SolverKind::apgd, {}, 0},
      EnvStatus{0.5, 2.0, kFlagBadDiagonal | kFlagAsymmetric, 0, EnvCode::unsupported, SolverKind::pgs, {}, 22}};
  solution.law = Law::coulomb;
  solution.solver = "apgd";
  solution.source = "a batch";
  return solution;
}

void expect_same(const SolutionFile& a, const SolutionFile& b) {
  EXPECT_EQ(a.precision, b.precision);
  expect_same_bits(a.lambda, b.lambda, "lambda");
  expect_same_bits(a.w, b.w, "w");
  expect_same_bits(a.status, b.status, "status");
  expect_same_bits(a.env_row_offsets, b.env_row_offsets, "env_row_offsets");
  EXPECT_EQ(a.law, b.law);
  EXPECT_EQ(a.solver, b.solver);
  EXPECT_EQ(a.source, b.source);
}

TEST_F(IoSolution, ComesBackBitForBitInBothPrecisions) {
  for (const Precision precision : {Precision::f32, Precision::f64}) {
    const SolutionFile solution = sample(precision);
    write_solution(at("s.h5"), solution);
    expect_same(read_solution(at("s.h5")), solution);
  }
}

SolutionFile sample_part() {
  SolutionFile solution = sample(Precision::f64);
  solution.shard = SolutionShard{1, 3, 5, 9, "00ff", "epoch=1 solver=apgd"};
  return solution;
}

TEST_F(IoSolution, APartSaysOfWhichWhole) {
  write_solution(at("s.h5"), sample_part());
  const SolutionFile solution = read_solution(at("s.h5"));
  expect_same(solution, sample_part());
  ASSERT_TRUE(solution.shard);
  EXPECT_EQ(solution.shard->index, 1);
  EXPECT_EQ(solution.shard->count, 3);
  EXPECT_EQ(solution.shard->first_environment, 5);
  EXPECT_EQ(solution.shard->environment_count, 9);
  EXPECT_EQ(solution.shard->input, "00ff");
  EXPECT_EQ(solution.shard->options, "epoch=1 solver=apgd");
  write_solution(at("s.h5"), sample(Precision::f64));
  EXPECT_FALSE(read_solution(at("s.h5")).shard);
}

TEST_F(IoSolution, APartThatCannotBeIsRefused) {
  const auto refusal = [&](const char* attribute, std::int64_t value) {
    write_solution(at("s.h5"), sample_part());
    {
      Spoiler file(at("s.h5"));
      file.put_attribute(attribute, H5T_NATIVE_INT64, &value);
    }
    return message_of(ErrorCode::bad_file, [&] { read_solution(at("s.h5")); });
  };
  EXPECT_THAT(refusal("shard_index", 3), HasSubstr("'shard_index' is 3, expected less than shard_count, 3"));
  EXPECT_THAT(refusal("shard_index", -1), HasSubstr("'shard_index' is -1, expected at least 0"));
  EXPECT_THAT(refusal("shard_count", 0), HasSubstr("'shard_count' is 0, expected at least 1"));
  EXPECT_THAT(refusal("shard_first_environment", 8), HasSubstr("2 environments from there are not in 9"));
  EXPECT_THAT(refusal("shard_environments", 6), HasSubstr("2 environments from there are not in 6"));
}

TEST_F(IoSolution, SinglePrecisionIsStoredInHalfTheWidth) {
  write_solution(at("s.h5"), sample(Precision::f32));
  const Spoiler file(at("s.h5"));
  const hid_t dataset = H5Dopen2(file.file(), "lambda", H5P_DEFAULT);
  EXPECT_EQ(H5Dget_storage_size(dataset), 4 * sizeof(float));
  H5Dclose(dataset);
}

TEST_F(IoSolution, LambdaAloneSuffices) {
  Spoiler::make(at("s.h5")).put("lambda", std::vector<double>{1.0, 2.0});
  const SolutionFile solution = read_solution(at("s.h5"));
  EXPECT_EQ(solution.lambda, (std::vector<double>{1.0, 2.0}));
  EXPECT_EQ(solution.precision, Precision::f64);
  EXPECT_TRUE(solution.w.empty());
  EXPECT_TRUE(solution.status.empty());
  EXPECT_TRUE(solution.env_row_offsets.empty());
}

TEST_F(IoSolution, AStatusWithoutItsDetailsIsReadAsZeros) {
  write_solution(at("s.h5"), sample(Precision::f64));
  {
    Spoiler file(at("s.h5"));
    for (const char* part : {"flags", "iterations", "residual", "residual_absolute", "answered_by", "islands"})
      file.remove(part);
  }
  const SolutionFile solution = read_solution(at("s.h5"));
  ASSERT_EQ(solution.status.size(), 2U);
  EXPECT_EQ(solution.status[1].code, EnvCode::unsupported);
  EXPECT_EQ(solution.status[0].iterations, 0);
  EXPECT_EQ(solution.status[1].islands, 0);
}

TEST_F(IoSolution, SolversThatTakeNoContactBatchComeBack) {
  SolutionFile written = sample(Precision::f64);
  written.status[0].solver = SolverKind::velocity_newton;
  written.status[1].solver = SolverKind::multigrid;
  write_solution(at("s.h5"), written);
  const SolutionFile solution = read_solution(at("s.h5"));
  EXPECT_EQ(solution.status[0].solver, SolverKind::velocity_newton);
  EXPECT_EQ(solution.status[1].solver, SolverKind::multigrid);
}

TEST_F(IoSolution, MalformedSolutionsAreRefusedInOneSentence) {
  const auto refusal = [&](const std::function<void(Spoiler&)>& spoil) {
    write_solution(at("s.h5"), sample(Precision::f64));
    {
      Spoiler file(at("s.h5"));
      spoil(file);
    }
    return message_of(ErrorCode::bad_file, [&] { read_solution(at("s.h5")); });
  };
  EXPECT_THAT(refusal([](Spoiler& f) { f.remove("lambda"); }), HasSubstr("s.h5: dataset 'lambda' is missing"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.put("lambda", std::vector<std::int64_t>{1, 2, 3, 4}); }),
              HasSubstr("dataset 'lambda' holds integers, expected floating-point numbers"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.put("w", std::vector<double>{1.0}); }),
              HasSubstr("dataset 'w' has 1 elements, expected 4"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.put("status", std::vector<std::int32_t>{0, 8}); }),
              HasSubstr("dataset 'status' holds 8 at position 1, the last code known is 7"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.put("status", std::vector<std::int32_t>{0, 300}); }),
              HasSubstr("dataset 'status' holds 300 at position 1, which does not fit 8 bits"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.put("answered_by", std::vector<std::int32_t>{0, 77}); }),
              HasSubstr("dataset 'answered_by' holds 77"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.put("answered_by", std::vector<std::int32_t>{0, 255}); }),
              HasSubstr("dataset 'answered_by' holds 255 at position 1, which is no solver that answers"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.remove("env_row_ptr"); }),
              HasSubstr("dataset 'env_row_ptr' is missing, 'status' needs it"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.put("env_row_ptr", std::vector<std::int64_t>{0, 3, 5}); }),
              HasSubstr("dataset 'env_row_ptr' ends at 5, expected 4"));
  EXPECT_THAT(refusal([](Spoiler& f) { f.put_attribute("format", std::string("contact-batch")); }),
              HasSubstr("attribute 'format' is 'contact-batch', expected 'contact-solution' or none"));
}

TEST_F(IoSolution, LengthsThatDoNotFitAreRefusedBeforeAFileIsMade) {
  const auto refusal = [&](const std::function<void(SolutionFile&)>& spoil) {
    SolutionFile solution = sample(Precision::f64);
    spoil(solution);
    return message_of(ErrorCode::invalid_argument, [&] { write_solution(at("s.h5"), solution); });
  };
  EXPECT_THAT(refusal([](SolutionFile& s) { s.w.pop_back(); }), HasSubstr("solution.w has 3 elements, expected 4"));
  EXPECT_THAT(refusal([](SolutionFile& s) { s.status.pop_back(); }), HasSubstr("solution.status has 1 elements"));
  EXPECT_THAT(refusal([](SolutionFile& s) { s.env_row_offsets.clear(); }), HasSubstr("env_row_offsets is empty"));
  EXPECT_THAT(refusal([](SolutionFile& s) { s.lambda.push_back(0.0); }), HasSubstr("elements, expected 5"));
  EXPECT_FALSE(std::filesystem::exists(at("s.h5")));
}

}  // namespace
}  // namespace stiction::io::test
