noperspective in vec2 at;
flat in float amplitude;
layout(location = 0) out vec4 deposited;

void main() { deposited = vec4(amplitude * exp(-dot(at, at))); }
