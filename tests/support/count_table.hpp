#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace stiction::test {

/// A committed CSV table of counts, a row a name, that a test compares with. `STICTION_UPDATE_COUNTS=1` writes it anew
/// instead, from the rows that were added.
class CountTable {
 public:
  CountTable(std::string path, std::string head) : path_(std::move(path)), text_(std::move(head) + "\n") {
    if (is_updated()) return;
    std::ifstream file(path_);
    std::string line;
    std::getline(file, line);
    EXPECT_EQ(line + "\n", text_) << path_;
    while (std::getline(file, line)) {
      std::vector<std::string> fields;
      std::istringstream rest(line);
      for (std::string field; std::getline(rest, field, ',');) fields.push_back(field);
      rows_[fields.at(0)] = {fields.begin() + 1, fields.end()};
    }
  }
  ~CountTable() {
    std::printf("%s", text_.c_str());
    if (is_updated()) std::ofstream(path_) << text_;
  }
  CountTable(const CountTable&) = delete;
  CountTable& operator=(const CountTable&) = delete;

  [[nodiscard]] static bool is_updated() { return std::getenv("STICTION_UPDATE_COUNTS") != nullptr; }
  /// Adds a row as it was found. Returns the committed one's fields behind the name; none, with a failure, if it has
  /// none, and none if the table is written.
  std::vector<std::string> add(const std::string& name, const std::string& fields) {
    text_ += name + "," + fields + "\n";
    if (is_updated()) return {};
    const auto row = rows_.find(name);
    EXPECT_TRUE(row != rows_.end()) << path_ << " has no " << name;
    return row == rows_.end() ? std::vector<std::string>() : row->second;
  }

 private:
  std::string path_, text_;
  std::map<std::string, std::vector<std::string>> rows_;
};

}  // namespace stiction::test
