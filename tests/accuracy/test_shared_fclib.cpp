#include <gtest/gtest.h>

#if defined(STICTION_TEST_HAS_IO)
#include "stiction/error.hpp"
#include "tests/support/systems/real_files.hpp"
#endif

/// The files of the FCLIB collection as they were published. They are local problems, global ones condensed by the
/// reader, and one rolling problem that cannot be stated here.
namespace stiction::test {
namespace {

#if defined(STICTION_TEST_HAS_IO)

struct FclibFile {
  const char* name;
  io::FileKind kind;
  bool slow = false;  ///< seconds of interior point: to one tolerance only
};

const FclibFile kFiles[] = {{"Box_Stacks-i0122-82-5", io::FileKind::fclib_global},
                            {"Capsules-i125-1213", io::FileKind::fclib_local},
                            {"CubeH8", io::FileKind::fclib_global},
                            {"LMGC_100_PR_PerioBox-i00361-60-03000", io::FileKind::fclib_local},
                            {"LMGC_GFC3D-i00001-1-00000", io::FileKind::fclib_global},
                            {"LMGC_GFC3D-i00501-4-00000", io::FileKind::fclib_global},
                            {"LMGC_GlobalFrictionContactProblem00046", io::FileKind::fclib_global},
                            {"Spheres-i099-356-679", io::FileKind::fclib_global},
                            {"local_problem_test", io::FileKind::fclib_local},
                            {"spheres-in-a-box-98-i10000-256-10", io::FileKind::fclib_global, true}};

std::filesystem::path path_of(const std::string& name) {
  return shared_file("fclib/" + name + ".hdf5");
}

class SharedFclib : public testing::TestWithParam<FclibFile> {};

TEST_P(SharedFclib, IsSolvedByAutoAndConfirmedByTheJudge) {
  const FclibFile& file = GetParam();
  const auto path = path_of(file.name);
  if (!std::filesystem::exists(path)) GTEST_SKIP() << absent(path);
  EXPECT_EQ(io::detect(path), file.kind);
  const ContactBatch<double> batch = io::read_batch(path).batch;
  ASSERT_EQ(batch.env_count(), 1);
  EXPECT_EQ(batch.law(), Law::coulomb);
  for (const double tolerance : {1e-6, 1e-8})
    if (!file.slow || tolerance == 1e-6)
      expect_solved_but_for(file.name, batch, options(SolverKind::automatic, tolerance, 20000), {});
}

INSTANTIATE_TEST_SUITE_P(Files, SharedFclib, testing::ValuesIn(kFiles), [](const auto& file) {
  std::string name = file.param.name;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

TEST(SharedFclibFiles, ARollingProblemIsRefusedWithASentence) {
  const auto path = path_of("Chute-ndof-768-nc-4-3");
  if (!std::filesystem::exists(path)) GTEST_SKIP() << absent(path);
  EXPECT_EQ(io::detect(path), io::FileKind::fclib_rolling);
  try {
    static_cast<void>(io::read_batch(path));
    FAIL() << "a rolling problem was read";
  } catch (const Error& error) {
    const std::string said = error.what();
    EXPECT_EQ(said.rfind(path.string(), 0), 0U) << said;
    EXPECT_NE(said.find("rolling problem"), std::string::npos) << said;
  }
}

TEST(SharedFclibFiles, AreTenThatCanBeStatedAndOneThatCannot) {
  const auto folder = shared_file("fclib");
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << absent(folder);
  std::ptrdiff_t files = 0;
  for (const auto& file : std::filesystem::directory_iterator(folder)) files += file.path().extension() == ".hdf5";
  EXPECT_EQ(files, std::ssize(kFiles) + 1);
}

#else

TEST(SharedFclibFiles, ARollingProblemIsRefusedWithASentence) {
  GTEST_SKIP() << "this build reads no HDF5 files: no shared problem is solved";
}

#endif

}  // namespace
}  // namespace stiction::test
