// Clips stand still until somebody asks: the picture's place shows one or the other.
(() => {
  const all = find('play-all');
  const buttons = [...document.querySelectorAll('.play')];

  function show(button, moving) {
    const image = button.closest('figure').querySelector('img');
    image.dataset.picture ??= image.getAttribute('src');
    image.src = moving ? image.dataset.clip : image.dataset.picture;
    button.textContent = moving ? 'stop' : 'play';
    button.setAttribute('aria-pressed', moving);
  }

  for (const button of buttons) {
    button.addEventListener('click', () => show(button, button.textContent === 'play'));
  }
  all.addEventListener('click', () => {
    const moving = all.getAttribute('aria-pressed') !== 'true';
    all.setAttribute('aria-pressed', moving);
    all.textContent = moving ? 'stop all clips' : 'play all clips';
    buttons.forEach((button) => show(button, moving));
  });
})();
