# ROS 2 Jazzy with this workspace, built over the ROS of the image. NOT TRIED: there was no Docker where this was written.
#   docker build -t dart_skill .
#   docker run --rm -it -v "$PWD/output:/workspace/output" dart_skill dart-skill demo      # what it writes stays in ./output
#   docker run --rm -it --network host dart_skill dart-skill up --viewer                   # the page listens on 127.0.0.1 alone
FROM ros:jazzy

# What set-up asks for: compilers are in the image. Without byte code being written, every node would compile what it imports.
RUN apt-get update && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends \
        build-essential python3-dev python3-venv \
    && rm -rf /var/lib/apt/lists/*

WORKDIR /workspace
COPY . .
RUN make setup

# Nothing leaves the container unless its user says so.
ENV ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
ENTRYPOINT ["/bin/bash", "-c", "source /workspace/tools/env.sh && exec \"$@\"", "dart_skill"]
CMD ["bash"]
