#include <cstdio>
#include <exception>
#include <filesystem>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/io/hdf5_out.hpp"
#include "stiction/config.hpp"
#include "stiction/error.hpp"
#include "stiction/io.hpp"
#include "tests/fuzz/sanitizer_options.hpp"
#include "tests/fuzz/seed_copy.hpp"

// Writes small valid files of every kind into a folder, for the fuzzer to start from, and reads each of them.
namespace {

stiction::io::Recording recording(int contacts) {
  stiction::Environment<double> environment;
  for (int i = 0; i < contacts; ++i) environment.cones.push_back({stiction::ConeKind::friction, 3, -1});
  for (int row = 0; row < 3 * contacts; ++row) {
    environment.column.push_back(row);
    environment.A.push_back(1.0 + row);
    environment.row_offsets.push_back(row + 1);
    environment.b.push_back(-1.0);
    environment.mu.push_back(0.5);
  }
  stiction::io::Recording result;
  result.batch.set_law(stiction::Law::coulomb);
  result.batch.add(environment);
  result.env_name = {"seed"};
  result.step = {1};
  const auto rows = static_cast<std::size_t>(3 * contacts);
  result.lambda_ref.assign(rows, 0.0);
  result.env_dof_offsets = {0, 1};
  result.J = {std::vector<stiction::Offset>(rows + 1, 0), {}, {}};
  result.M = {{0, 1}, {0}, {1.0}};
  return result;
}

/// Everything that a contact-batch file may hold: bounds that are not symmetric, manifolds, ids, steps, flags, limits
/// of single environments. Also how the batch was solved.
stiction::io::Recording full_recording() {
  stiction::io::Recording result = recording(2);
  auto arrays = result.batch.arrays();
  arrays.cone_kind = {stiction::ConeKind::friction, stiction::ConeKind::box, stiction::ConeKind::unilateral,
                      stiction::ConeKind::free};
  arrays.cone_row_offsets = {0, 3, 4, 5, 6};
  arrays.env_cone_offsets = {0, 4};
  arrays.cone_group = {0, 0, -1, -1};
  arrays.lo = {0, 0, 0, -0.5, 0, 0};
  arrays.hi = {0, 0, 0, 2, 0, 0};
  arrays.mu = {0, 0.5, 0.25, 0, 0, 0};
  arrays.env_flags = {stiction::kFlagContactsDropped};
  arrays.env_tolerance = {1e-3};
  arrays.env_max_iterations = {7};
  result.batch = stiction::ContactBatch<double>::from_arrays(stiction::Law::convex, arrays);
  result.cone_id = {7, 9, 11, 13};
  result.dt = {0.005};
  result.v_free = {1};
  result.v_ref = {0.5};
  result.row_target.assign(6, 0.25);
  stiction::io::RecordedSolve solve;
  solve.lambda.assign(6, 0.5);
  solve.warm_start.assign(6, 0.25);
  solve.max_iterations = 10;
  solve.numerics_epoch = stiction::kNumericsEpoch;
  result.solve = solve;
  return result;
}

template <class T>
void put(stiction::io::OutputFile& file, const std::string& path, const std::vector<T>& values) {
  file.array(path, std::span<const T>(values));
}

/// A matrix by columns, as FCLIB stores it.
void put_matrix(stiction::io::OutputFile& file, const std::string& path, int rows, int columns,
                const std::vector<std::int32_t>& begin, const std::vector<std::int32_t>& row,
                const std::vector<double>& values) {
  file.group(path);
  for (const auto& [name, value] :
       {std::pair{"m", rows}, {"n", columns}, {"nz", -1}, {"nzmax", static_cast<int>(row.size())}})
    put(file, path + "/" + name, std::vector<std::int32_t>{value});
  put(file, path + "/p", begin);
  put(file, path + "/i", row);
  put(file, path + "/x", values);
}

/// Two planar contacts, and one equality that couples them: V, R and s.
void write_fclib_equalities(const std::filesystem::path& path) {
  stiction::io::OutputFile file(path);
  const std::string root = "fclib_local";
  file.group(root);
  put(file, root + "/spacedim", std::vector<std::int32_t>{2});
  put_matrix(file, root + "/W", 4, 4, {0, 1, 2, 3, 4}, {0, 1, 2, 3}, {2, 2, 3, 3});
  put_matrix(file, root + "/V", 4, 1, {0, 2}, {0, 2}, {1, -1});
  put_matrix(file, root + "/R", 1, 1, {0, 1}, {0}, {4});
  file.group(root + "/vectors");
  put(file, root + "/vectors/q", std::vector<double>{-1, 0.5, -2, 0});
  put(file, root + "/vectors/mu", std::vector<double>{0.8, 0.3});
  put(file, root + "/vectors/s", std::vector<double>{0.25});
  file.commit();
}

/// One planar contact of three degrees of freedom; with `rolling` a kind that readers refuse by name.
void write_fclib_global(const std::filesystem::path& path, bool rolling) {
  stiction::io::OutputFile file(path);
  const std::string root = rolling ? "fclib_global_rolling" : "fclib_global";
  file.group(root);
  put(file, root + "/spacedim", std::vector<std::int32_t>{2});
  put_matrix(file, root + "/M", 3, 3, {0, 2, 3, 5}, {0, 2, 1, 0, 2}, {2, 2, 2, 2, 4});
  put_matrix(file, root + "/H", 3, 2, {0, 1, 3}, {0, 1, 2}, {1, 1, 1});
  put_matrix(file, root + "/G", 3, 1, {0, 1}, {1}, {2});
  file.group(root + "/vectors");
  put(file, root + "/vectors/f", std::vector<double>{2, 4, 0});
  put(file, root + "/vectors/w", std::vector<double>{0.5, -1});
  put(file, root + "/vectors/mu", std::vector<double>{0.8});
  put(file, root + "/vectors/b", std::vector<double>{8});
  if (rolling) put(file, root + "/vectors/mu_r", std::vector<double>{0.1});
  file.commit();
}

void write_solutions(const std::filesystem::path& folder) {
  stiction::io::SolutionFile solution;
  solution.lambda.assign(6, 0.0);
  solution.env_row_offsets = {0, 6};
  solution.status.assign(1, stiction::EnvStatus{});
  stiction::io::write_solution(folder / "solution.h5", solution);
  solution.precision = stiction::Precision::f32;
  solution.w.assign(6, 0.5);
  solution.law = stiction::Law::coulomb;
  solution.solver = "npgs";
  solution.source = "seed";
  stiction::io::write_solution(folder / "solution_single.h5", solution);
}

void write_checkpoint(const std::filesystem::path& folder) {
  stiction::io::CheckpointFile checkpoint;
  checkpoint.run = "seed";
  checkpoint.world.position = {1, 2, 3};
  checkpoint.world.orientation = {1, 0, 0, 0};
  checkpoint.world.twist.assign(6, 0.5);
  checkpoint.world.wrench.assign(6, 0.0);
  checkpoint.world.contact_offsets = {0, 2};
  checkpoint.world.contact_id = {64, 65};
  checkpoint.world.impulse.assign(6, 0.25);
  stiction::io::write_checkpoint(folder / "checkpoint.h5", checkpoint);
}

/// Every seed is read; those of rolling problems are refused.
void read_all(const std::filesystem::path& folder) {
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("solution")) {
      stiction::io::read_solution(entry.path());
    } else if (name.starts_with("checkpoint")) {
      stiction::io::read_checkpoint(entry.path());
    } else if (name.starts_with("rolling")) {
      if (stiction::io::detect(entry.path()) != stiction::io::FileKind::fclib_rolling) throw std::runtime_error(name);
    } else {
      stiction::io::read_batch(entry.path());
    }
  }
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 2) {
    std::fprintf(stderr, "usage: fuzz_seeds FOLDER\n");
    return 2;
  }
  const std::filesystem::path folder = argv[1];
  std::filesystem::create_directories(folder);
  constexpr int kPlain = 2, kPacked = 400;  // contacts: below and above the size from which arrays are packed
  stiction::io::write_batch(folder / "plain.h5", recording(kPlain));
  stiction::io::write_batch(folder / "packed.h5", recording(kPacked));
  stiction::io::write_batch(folder / "full.h5", full_recording());
  stiction::io::write_fclib_local(folder / "fclib.hdf5", recording(kPlain), 0);
  write_fclib_global(folder / "global.hdf5", false);
  write_fclib_global(folder / "rolling.hdf5", true);
  write_fclib_equalities(folder / "equalities.hdf5");
  write_solutions(folder);
  write_checkpoint(folder);
  stiction::fuzz::copy_to_latest(folder / "full.h5", folder / "full_latest.h5");
  stiction::fuzz::copy_to_latest(folder / "global.hdf5", folder / "global_latest.hdf5");
  stiction::fuzz::copy_to_latest(folder / "solution.h5", folder / "solution_latest.h5");
  read_all(folder);
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "fuzz_seeds: %s\n", error.what());
  return 1;
}
