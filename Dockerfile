# A vehicle with its load, ready for ground control:
#   docker build -t sitl-bridge .
#   docker run --rm -p 18570:18570/udp -p 14580:14580/udp sitl-bridge
# Clients speak first: udpout:127.0.0.1:18570 (ground stations), udpout://127.0.0.1:14580 (MAVSDK).

FROM python:3.12-slim AS build
WORKDIR /source
COPY . .
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheels .

FROM python:3.12-slim
# A copy, not a mount: builders without BuildKit take it, too. It is one more layer of a megabyte.
COPY --from=build /wheels /wheels
RUN pip install --no-cache-dir "$(ls /wheels/*.whl)[view]" \
    && useradd --create-home --uid 1000 pilot
USER pilot
WORKDIR /home/pilot
# Machine code for this processor; on another one the first flight compiles again.
RUN sitl warmup
EXPOSE 14560/udp 18570/udp 14580/udp 4560/tcp 8080/tcp
ENTRYPOINT ["sitl"]
CMD ["fly", "hold", "--expose"]
