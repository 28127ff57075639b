#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace stiction::test {

struct Finished {
  int status = -1;  ///< exit status; 128 + signal if a signal ended it
  std::string out, err;
};

/// Runs the built `stiction` with these arguments, neither stream a terminal. `environment` entries ("NAME=value")
/// are added to the test's own.
Finished run_stiction(const std::vector<std::string>& arguments, const std::vector<std::string>& environment = {});

/// A fresh folder that goes when the object does.
class Folder {
 public:
  Folder();
  ~Folder();
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  [[nodiscard]] std::string operator/(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

std::string read_text(const std::string& path);
void write_text(const std::string& path, const std::string& text);

/// Value after a label at the beginning of a line of the readable reports; empty if there is no such line.
std::string field(const std::string& text, const std::string& label);

}  // namespace stiction::test
