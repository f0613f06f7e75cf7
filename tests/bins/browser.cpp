#include "tests/bins/browser.h"

#include <cstdlib>
#include <regex>

namespace shoal::testing {

std::string chromium(const TemporaryFolder& folder) {
  if (const char* named = std::getenv("SHOAL_CHROMIUM"); named != nullptr) return named;
  const ProgramRun found = run_shell(folder, "command -v chromium-headless-shell || command -v chromium || "
                                             "command -v chromium-browser || command -v google-chrome");
  return found.out.substr(0, found.out.find('\n'));
}

ProgramRun open_page(const TemporaryFolder& folder, const std::string& page, const std::vector<std::string>& more) {
  std::vector<std::string> command = {chromium(folder), "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
                                      "--host-resolver-rules=MAP * ~NOTFOUND", "--enable-logging=stderr",
                                      "--virtual-time-budget=5000", "--window-size=1200,900"};
  command.insert(command.end(), more.begin(), more.end());
  command.insert(command.end(), {"--dump-dom", "file://" + page});
  return Program(folder, command).wait();
}

std::vector<std::string> all_matches(const std::string& text, const std::string& pattern) {
  std::vector<std::string> found;
  const std::regex expression(pattern);
  for (std::sregex_iterator it(text.begin(), text.end(), expression), end; it != end; ++it) found.push_back((*it)[1].str());
  return found;
}

std::string between(const std::string& text, const std::string& from, const std::string& to) {
  const size_t start = text.find(from);
  if (start == std::string::npos) return "";
  const size_t end = text.find(to, start + from.size());
  return end == std::string::npos ? "" : text.substr(start + from.size(), end - start - from.size());
}

}  // namespace shoal::testing
