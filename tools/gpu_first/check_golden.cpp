#include <algorithm>

#include "stiction/error.hpp"
#include "tests/support/golden/cases.hpp"
#include "tests/support/machines/every_solver.hpp"
#include "tools/gpu_first/check.hpp"

/// The golden table, which is of no machine: the answers of every one within one numerics epoch.
namespace stiction::gpu_first {

namespace {

/// Rows that a device stood in for by the CPU takes: every so many.
constexpr std::size_t kStride = 12;

/// Returns false if a word of the row's name is a solver whose kernels were not compiled.
bool is_carried(const Target* target, const std::string& row) {
  if (target == nullptr) return true;
  for (std::size_t begin = 0; begin < row.size();) {
    const std::size_t end = std::min(row.find_first_of("/ ", begin), row.size());
    for (const SolverKind solver : test::kEverySolver)
      if (row.substr(begin, end - begin) == to_string(solver) && !carries(*target, solver)) return false;
    begin = end + 1;
  }
  return true;
}

void compare_form(Report& report, const std::string& form) {
  const test::GoldenCases rows = test::golden_cases_of(form);
  if (rows.empty()) return report.judge("", "the golden table has no such row");
  const Device device = report.target() == nullptr ? Device::cpu() : report.target()->device();
  const std::size_t stride = report.setting().full ? 1 : kStride;
  std::size_t equal = 0, count = 0, absent = 0;
  const double start = wall_seconds();
  for (std::size_t k = 0; k < rows.size(); k += stride) {
    if (!is_carried(report.target(), rows[k].name)) {
      ++absent;
      continue;
    }
    ++count;
    try {
      const std::uint64_t found = rows[k].hash(device), golden = test::goldens().at(rows[k].name);
      if (found == golden)
        ++equal;
      else
        report.judge(rows[k].name, "its hash is " + hex(found) + ", in the golden table " + hex(golden));
    } catch (const Error& error) {
      report.judge(rows[k].name, error.what());
    }
  }
  report.judge("", equal == count ? "" : std::to_string(count - equal) + " of " + std::to_string(count) + " differ");
  report.measured("rows", [&](JsonLine& line) {
    line.add("rows", count).add("equal", equal).add("not_compiled", absent).add("seconds", wall_seconds() - start);
  });
}

}  // namespace

void add_golden(Checks& checks) {
  for (const char* const form : test::kGoldenForms)
    checks.push_back({std::string("golden/") + form, 60, [form](Report& report) { compare_form(report, form); }});
}

}  // namespace stiction::gpu_first
