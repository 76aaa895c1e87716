// Which primitive, and of which object, a pixel sees first.
flat in uvec2 seen;
layout(location = 0) out uvec2 visible;

void main()
{
    visible = seen;
}
