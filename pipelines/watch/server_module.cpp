// libhsi4d_server.so: the only file that includes cpp-httplib. It links nothing of this project.
#include <chrono>
#include <httplib.h>
#include <string>
#include <thread>

#include "pipelines/watch/server_library.h"

namespace hsi4d {

struct LocalServer {
  httplib::Server server;
  int port = 0;
};

namespace {

constexpr const char* kAddress = "127.0.0.1";
constexpr std::chrono::milliseconds kLook{50};  // between looks whether it is to stop
constexpr int kThreads = 8;                     // a browser keeps up to six connections open
constexpr int kPatience = 2;                    // seconds that a silent connection may keep a thread
constexpr std::size_t kLargestBody = 4096;      // none is wanted

/// Another server of the same user at the same port is refused, which the library would let in.
void allow_reuse_after_end(socket_t socket) {
  const int yes = 1;
  setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
}

void answer_request(const httplib::Request& request, httplib::Response& response,
                    const std::function<ServedReply(const ServedRequest&)>& answer) {
  ServedRequest asked{request.method, request.get_header_value("Host"), request.path};
  for (const auto& [key, value] : request.params) asked.parameters.emplace(key, value);
  const ServedReply reply = answer(asked);
  response.status = reply.status;
  if (reply.status == 405) response.set_header("Allow", "GET");
  response.set_content(reply.body, reply.type.c_str());
}

LocalServer* open(int port, std::function<ServedReply(const ServedRequest&)> answer) {
  auto opened = std::make_unique<LocalServer>();
  httplib::Server& server = opened->server;
  server.new_task_queue = [] { return new httplib::ThreadPool(kThreads); };
  server.set_socket_options(allow_reuse_after_end);
  server.set_keep_alive_max_count(1);        // an idle connection would keep its thread, and the end waiting
  server.set_keep_alive_timeout(kPatience);  // for the first request too
  server.set_read_timeout(kPatience);
  server.set_payload_max_length(kLargestBody);
  server.set_default_headers({{"Content-Security-Policy",
                               "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
                               "connect-src 'self'; base-uri 'none'; "
                               "form-action 'none'; frame-ancestors 'none'"},
                              {"Cross-Origin-Resource-Policy", "same-origin"},
                              {"X-Content-Type-Options", "nosniff"},
                              {"Referrer-Policy", "no-referrer"},
                              {"Cache-Control", "no-store"}});
  server.set_pre_routing_handler(
      [answer = std::move(answer)](const httplib::Request& request, httplib::Response& response) {
        answer_request(request, response, answer);
        return httplib::Server::HandlerResponse::Handled;
      });
  opened->port = port;
  const bool is_bound =
      port == 0 ? (opened->port = server.bind_to_any_port(kAddress)) > 0 : server.bind_to_port(kAddress, port);
  return is_bound ? opened.release() : nullptr;
}

int port_of(const LocalServer& server) { return server.port; }

void serve(LocalServer& server, const std::function<bool()>& stop_requested) {
  std::thread listener([&server] { server.server.listen_after_bind(); });
  while (!stop_requested()) std::this_thread::sleep_for(kLook);
  server.server.stop();
  listener.join();
}

void close(LocalServer* server) { delete server; }

constexpr ServerLibrary kLibrary = {open, port_of, serve, close};

}  // namespace
}  // namespace hsi4d

extern "C" __attribute__((visibility("default"))) const hsi4d::ServerLibrary* hsi4d_server_library() {
  return &hsi4d::kLibrary;
}
