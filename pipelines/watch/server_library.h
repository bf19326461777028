// What this project takes from cpp-httplib, as a library of its own that is loaded when `hsi4d watch` begins: a server
// of HTTP that only this machine reaches.
#pragma once

#include <functional>
#include <map>
#include <string>

namespace hsi4d {

struct ServedRequest {
  std::string method, host, path;  ///< host: as the header says; path: decoded, without parameters
  std::map<std::string, std::string> parameters = {};

  /// "" where there is none.
  std::string parameter(const std::string& key) const {
    const auto found = parameters.find(key);
    return found == parameters.end() ? "" : found->second;
  }
};

struct ServedReply {
  int status = 200;
  std::string type, body;
};

struct LocalServer;

/// The library's functions.
struct ServerLibrary {
  /// Listens at 127.0.0.1; null where the port is taken.
  /// @param port    0: any that is free
  /// @param answer  called by several threads at once; must not throw
  LocalServer* (*open)(int port, std::function<ServedReply(const ServedRequest&)> answer);
  int (*port)(const LocalServer& server);
  /// Answers until it is asked to stop.
  void (*serve)(LocalServer& server, const std::function<bool()>& stop_requested);
  void (*close)(LocalServer* server);
};

/// The library; the first call loads it. Throws InternalError telling where it was sought.
const ServerLibrary& server_library();

}  // namespace hsi4d
