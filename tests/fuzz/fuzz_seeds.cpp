#include <cstdio>
#include <exception>
#include <filesystem>

#include "stiction/io.hpp"

// Writes one small valid file of every kind into a folder, for the fuzzer to start from.
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
  stiction::io::write_fclib_local(folder / "fclib.hdf5", recording(kPlain), 0);
  stiction::io::SolutionFile solution;
  solution.lambda.assign(6, 0.0);
  solution.env_row_offsets = {0, 6};
  solution.status.assign(1, stiction::EnvStatus{});
  stiction::io::write_solution(folder / "solution.h5", solution);
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "fuzz_seeds: %s\n", error.what());
  return 1;
}
