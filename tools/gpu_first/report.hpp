#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "tools/gpu_first/json_line.hpp"
#include "tools/gpu_first/target.hpp"

namespace stiction::gpu_first {

/// A hash of each environment's answer, or of whatever else is compared one by one.
using Hashes = std::vector<std::uint64_t>;

/// Beginning of a line that is shown at once.
inline constexpr char kSaid[] = "> ";

/// Arguments of the program.
struct Setting {
  std::string device = "cuda";  ///< cuda, emulated, ptx (the generated code, by the CPU) or cpu (no comparison)
  bool full = true;             ///< sizes for a GPU, else for a device that the CPU stands in for
  double patience = 1;          ///< factor on time limits
  std::string out;              ///< file that lines are appended to
  std::string hashes;           ///< committed hashes; "check,part,size,hash"
  std::string write_hashes;     ///< file that the hashes found here are appended to
  std::string batches;          ///< folder of recorded batches
  [[nodiscard]] const char* size() const { return full ? "full" : "small"; }
};

/// Appends the results of one check, each at once.
class Report {
 public:
  Report(const Setting& setting, Target* target, std::string check);

  [[nodiscard]] const Setting& setting() const { return setting_; }
  /// The device; null if there is nothing but the CPU.
  [[nodiscard]] Target* target() const { return target_; }
  /// Returns true if everything so far was as it should be.
  [[nodiscard]] bool good() const { return good_; }

  /// Compares the CPU's answers with the device's and with the hash that is committed. `describe` names the first item
  /// that differs.
  void compare(const std::string& part, const std::function<Hashes()>& here, const std::function<Hashes()>& there,
               const std::function<void(JsonLine&, std::size_t)>& describe = {});
  /// A result that is right or wrong by itself; `what` is empty or the fault.
  void judge(const std::string& part, const std::string& what);
  /// Numbers that are neither.
  void measured(const std::string& part, const std::function<void(JsonLine&)>& numbers);
  /// A result in brief, shown at once and kept for the summary: "> subject | text".
  static void say(const std::string& subject, const std::string& text);
  void left_out(const std::string& part, const std::string& why);

 private:
  [[nodiscard]] JsonLine begin(const std::string& part, const std::string& result) const;
  void write(const JsonLine& line) const;
  [[nodiscard]] std::string key(const std::string& part) const;

  const Setting& setting_;
  Target* target_;
  std::string check_;
  std::map<std::string, std::string> committed_;
  bool good_ = true;
};

/// "0x" and 16 hexadecimal digits.
std::string hex(std::uint64_t hash);
/// All hashes joined into one.
std::uint64_t joined(const Hashes& hashes);
/// Appends to a file, whole or not at all as far as other processes see.
void append_line(const std::string& path, const std::string& line);

/// Seconds since some moment.
inline double wall_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace stiction::gpu_first
